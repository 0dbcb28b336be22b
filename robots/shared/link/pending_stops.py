"""Stops that neither bridge nor watchdog has confirmed yet. Each is a file in the run directory until it is answered.

Every process of the console on this computer reads and delivers them. So a stop is delivered even if the process that
received it ends, or the person closes the page. This module uses neither Django nor ROS, because a bridge reads the
folder before its robot can be driven.
"""

from __future__ import annotations

import logging
import os
import threading
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from uuid import UUID

import msgspec
from msgspec import Struct

from robots.shared import wire
from robots.shared.sentences import catalogued
from robots.shared.wire import LinkStop, PendingStop, Refusal, Stopped

log = logging.getLogger(__name__)

FOLDER = "stops"  # in the run directory
MOST_OF_ONE = 10  # stops of one robot; a clear may contain no more

OnSettled = Callable[[Stopped | Refusal], None]


class WaitingStop(Struct, frozen=True):
    """A press that has no answer yet."""

    name: str  # of the robot's files in the run directory (`name_of`)
    press: UUID
    robot: UUID | None  # None: any bridge that listens at the socket with this name
    by: str
    reason: str = ""
    at: float = 0.0  # time of day, seconds
    host: str | None = None  # with `port`: where the bridge listens, if it runs on another computer
    port: int | None = None

    def message(self) -> LinkStop:
        """Return the message to send."""
        return LinkStop(self.by, self.reason, robot=self.robot, press=self.press, waited=True)

    def on_wire(self) -> PendingStop:
        """Return the stop as pages receive it."""
        return PendingStop(self.by, self.reason, self.at)


def name_of(robot: UUID) -> str:
    """Return the name of this robot's files in the run directory, without suffix."""
    return robot.hex[:12]


class PendingStops:
    """The pending stops. For each robot the newest press counts. Thread-safe.

    A stop that cannot be written, or any stop if `run_dir` is None, is only in memory: only this process delivers it.
    """

    def __init__(self, run_dir: Path | None) -> None:
        self._folder = run_dir / FOLDER if run_dir else None
        self._lock = threading.Lock()
        self._unwritten: dict[str, WaitingStop] = {}
        # By robot: callbacks for the answer
        self._on_answer: defaultdict[str, list[OnSettled]] = defaultdict(list)

    def keep(self, stop: WaitingStop, on_answer: OnSettled | None = None) -> bool:
        """Keep `stop` until it is settled; it replaces older stops of this robot. Pass the answer to `on_answer`.

        Returns False if the stop cannot be written: then only this process has it, and older stops are not removed.
        """
        if on_answer is not None:
            with self._lock:
                self._on_answer[stop.name].append(on_answer)
        older = [found for found in self.of(stop.name) if found.press != stop.press]
        written = self._write(stop)
        with self._lock:
            self._unwritten.pop(stop.name, None)
            if not written:
                self._unwritten[stop.name] = stop
        if written:
            for found in older:
                self._remove(found)
        return written

    def all(self) -> list[WaitingStop]:
        """Return all pending stops, the newest last."""
        return self._found("")

    def of(self, name: str) -> list[WaitingStop]:
        """Return one robot's pending stops, the newest last; usually none or one."""
        return self._found(name)[-MOST_OF_ONE:]

    def _found(self, begin: str) -> list[WaitingStop]:
        """Return the pending stops of robots whose name begins so, the newest last."""
        with self._lock:
            found = [stop for name, stop in self._unwritten.items() if name.startswith(begin)]
        found += [stop for path in self._paths(begin) if (stop := _read(path)) is not None]
        return sorted(found, key=lambda stop: stop.at)

    def settle(self, stop: WaitingStop, answer: Stopped | Refusal) -> None:
        """Remove `stop`, which was confirmed or refused, and older stops of this robot; pass on the answer."""
        for found in self.of(stop.name):
            if found.at <= stop.at:
                self._remove(found)
        with self._lock:
            if (unwritten := self._unwritten.get(stop.name)) and unwritten.at <= stop.at:
                del self._unwritten[stop.name]
            on_answer = self._on_answer.pop(stop.name, [])
        for tell in on_answer:
            tell(answer)

    def _paths(self, name: str) -> list[Path]:
        if self._folder is None:
            return []
        try:
            names = os.listdir(self._folder)
        except FileNotFoundError:
            return []
        except OSError as error:
            log.error("pending stops cannot be read: %s", error)
            return []
        return [self._folder / found for found in names if found.startswith(name) and found.endswith(".json")]

    def _path(self, stop: WaitingStop) -> Path | None:
        return self._folder and self._folder / f"{stop.name}-{stop.press.hex}.json"

    def _write(self, stop: WaitingStop) -> bool:
        path = self._path(stop)
        if path is None:
            return False
        fresh = path.with_suffix(".new")
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
                file.write(wire.encode(stop))
                file.flush()
                os.fsync(file.fileno())
            fresh.replace(path)
        except OSError as error:
            log.error("a stop of %s by %s waits in this process alone: %s", stop.name, stop.by, error)
            return False
        return True

    def _remove(self, stop: WaitingStop) -> None:
        path = self._path(stop)
        try:
            if path is not None:
                path.unlink(missing_ok=True)
        except OSError as error:
            log.error("%s cannot be removed: %s", path, error)


def _read(path: Path) -> WaitingStop | None:
    """Read one pending stop. A damaged file also counts as a stop: its name contains the robot."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=WaitingStop)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.DecodeError, UnicodeError) as error:
        log.error("%s cannot be read: %s", path, error)
    try:
        name, press = path.stem.split("-")
        return WaitingStop(
            name, UUID(press), None, "somebody", catalogued("the file of this stop is damaged")
        )
    except ValueError:
        return None
