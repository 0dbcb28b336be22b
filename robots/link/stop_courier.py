"""Delivers pending stops, until bridge or watchdog confirms or refuses each of them.

The fleet supervisor always runs a courier. Another process starts one when a stop of its own is not answered; this
courier ends when no stop is pending.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from functools import cache
from pathlib import Path
from typing import cast
from uuid import UUID

from django.conf import settings

from robots.link.connections import LinkRefused
from robots.link.stop_delivery import reach, wait_for
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.pending_stops import OnSettled, PendingStops, WaitingStop, name_of
from robots.shared.wire import LinkStop, Refusal

log = logging.getLogger(__name__)

PACE_S = 0.5  # between two attempts


class Courier:
    """One thread delivers the stops of all robots; a robot that does not answer does not delay other robots' stops."""

    def __init__(self, stops: PendingStops) -> None:
        self._stops = stops
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stays = False

    def start(self, *, stays: bool = False) -> None:
        """Start the thread. It ends when no stop is pending; with `stays` it runs on, and waits for further stops."""
        with self._lock:
            self._stays = self._stays or stays
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="courier", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        try:
            wait_for(self._deliver_all())
        except Exception:
            log.exception("pending stops are not delivered by this process any more")
        finally:
            with self._lock:
                if self._thread is threading.current_thread():
                    self._thread = None

    async def _deliver_all(self) -> None:
        """Deliver until no stop is pending; with `stays`, for ever."""
        under_way: dict[str, asyncio.Task[None]] = {}
        while True:
            with self._lock:
                newest = {stop.name: stop for stop in self._stops.all()}
                if not (newest or under_way or self._stays):
                    self._thread = None  # the next `start` makes another thread
                    return
            under_way = {name: task for name, task in under_way.items() if not task.done()}
            for name in newest.keys() - under_way.keys():
                under_way[name] = asyncio.create_task(self._deliver(newest[name]))
            await asyncio.sleep(PACE_S)

    async def _deliver(self, stop: WaitingStop) -> None:
        try:
            answer = await reach(_address(stop), stop.message())
        except LinkRefused:
            return  # the next round tries again
        except Exception:
            log.exception("a stop of %s could not be sent", stop.name)
            return
        outcome = answer.text if isinstance(answer, Refusal) else answer.stop.state
        log.warning("the pending stop of %s by %s is delivered: %s", stop.name, stop.by, outcome)
        self._stops.settle(stop, answer)


def _address(stop: WaitingStop) -> LinkAddress:
    """Return the address of the robot's bridge, without a query of the database."""
    return LinkAddress(
        unix_path=str(settings.FLEET_RUN_DIR / f"{stop.name}.sock"),
        host=stop.host,
        port=stop.port,
        secret=settings.FLEET_LINK_SECRET,
        authority=settings.FLEET_LINK_CA,
    )


@cache
def _stops_in(run_dir: Path) -> PendingStops:
    return PendingStops(run_dir)


def pending_stops() -> PendingStops:
    """Return the pending stops of this computer."""
    return _stops_in(settings.FLEET_RUN_DIR)


@cache
def _courier_of(stops: PendingStops) -> Courier:
    return Courier(stops)


def courier() -> Courier:
    """Return the courier of this process."""
    return _courier_of(pending_stops())


def keep_pending(
    robot: UUID | None, address: LinkAddress, stop: LinkStop, on_answer: OnSettled | None = None
) -> tuple[WaitingStop, bool]:
    """Store the unanswered `stop`, so that every process of this computer delivers it; pass the answer to `on_answer`.

    Returns the pending stop, and whether it is written to the disk. If it is not, only this process delivers it, while
    it runs.
    """
    if stop.press is None or (address.unix_path is None and robot is None):
        raise ValueError("a stop that waits has a press and a robot")
    name = Path(address.unix_path).stem if address.unix_path else name_of(cast(UUID, robot))
    waiting = WaitingStop(
        name, stop.press, robot, stop.by, stop.reason, time.time(), host=address.host, port=address.port
    )
    written = pending_stops().keep(waiting, on_answer)
    courier().start()
    return waiting, written


def forget(robot: UUID) -> None:
    """Drop pending stops of a robot that was removed from the registry."""
    gone = Refusal("no_such_robot", "The robot is not registered any more.", "robot")
    for stop in pending_stops().of(name_of(robot))[-1:]:
        pending_stops().settle(stop, gone)
