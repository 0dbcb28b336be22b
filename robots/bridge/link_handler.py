"""Decode, check and answer the messages of links.

This module never blocks: a stop must not wait. A link may send 200 commands a second, far more than a stick
sends. Each further command is dropped in its own turn of the event loop, so that ticks, stops and sensors are
not delayed.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from functools import partial
from uuid import UUID

from robots.bridge.core import Core
from robots.bridge.lease.lease_orders import LeaseOrders
from robots.bridge.recorder.recorder_client import RecorderClient
from robots.bridge.served.client import ProcessClient
from robots.bridge.server.link_server import Link
from robots.bridge.topics.inspector_client import InspectorClient
from robots.shared import wire
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import catalogued, say

log = logging.getLogger(__name__)

DRIVES_PER_S = 200.0  # limit of a link; a stick sends 20 to 50
DRIVES_BURST = 50.0
REFUSAL_GAP_S = 0.25  # answer refused messages of one kind and code at most this often per link

_STOP, _VELOCITY = "link_stop", "velocity"
OTHER_ROBOT = wire.Refusal(
    "other_robot", "This bridge belongs to another robot, which was not stopped.", "robot"
)
_FLOOD = wire.Refusal(
    "flood",
    say("More than {most:.0f} commands a second.", most=DRIVES_PER_S),
    "wire",
    {"limit_per_s": DRIVES_PER_S},
)
_FAULT = wire.Refusal(
    "bridge_fault",
    "An error occurred in the bridge (see its log). It is unknown whether the request was carried out.",
    "robot",
)


class LinkHandler:
    """Handles the messages of one bridge's links."""

    def __init__(
        self,
        core: Core,
        lease_orders: LeaseOrders,
        inspector: InspectorClient,
        served: Mapping[wire.ProcessName, ProcessClient],
        recorder: RecorderClient,
    ) -> None:
        self._core = core
        self._robot = UUID(core.config.robot_id)
        self._lease_orders = lease_orders
        self._inspector = inspector
        self._served = served
        self._recorder = recorder
        self._drives: dict[Link, TokenBucket] = {}
        # time of the last answer, by kind and code
        self._refused: dict[Link, dict[tuple[str, str], float]] = {}

    def opened(self, link: Link) -> None:
        """Send the first message to a web process: this robot's id, without any state."""
        self._drives[link] = TokenBucket(DRIVES_PER_S, DRIVES_BURST)
        self._refused[link] = {}
        link.report(self._core.hello())

    def closed(self, link: Link) -> None:
        """Handle a closed link: driving through it stops."""
        self._core.link_lost(link.number, time.monotonic())
        self._lease_orders.forget(link)
        self._inspector.forget(link)
        for process in self._served.values():
            process.forget(link)
        del self._drives[link], self._refused[link]

    async def received(self, link: Link, raw: bytes) -> None:
        """Handle one message of the WebSocket."""
        if not self.handle(link, raw):
            await asyncio.sleep(0)

    def handle(self, link: Link, raw: bytes) -> bool:
        """Handle one message of WebSocket or drive lane. Return False if it was dropped by the flood limit."""
        now_s = time.monotonic()
        try:
            message = wire.link_request(raw)
        except wire.WireError as error:
            kind, seq = wire.heading(raw)
            if kind == _STOP:  # a damaged stop message stops the robot, too
                self._stop(
                    link, wire.LinkStop("somebody", catalogued("the message was damaged"), seq or 0), now_s
                )
                return True
            self._core.refused[error.refusal.code] += 1
            self._refuse(link, wire.Refused("link", error.refusal), now_s)
            return True
        match message:
            case wire.Drive():
                return self._drive(link, message, now_s)
            case wire.LinkVelocity(order=order):
                return self._velocity(link, order, now_s)
            case wire.Grant() | wire.Revoke() | wire.Pause():
                self._lease_orders.handle(link, message)
            case wire.LinkStop():
                self._stop(link, message, now_s)
            case wire.LinkClear():
                refusal = self._core.clear(message.number, now_s, message.presses)
                if refusal is None:
                    self._latch_changed(link, message.seq, None, now_s)
                    log.info("stop %d was cleared by %s", message.number, message.by)
                else:
                    link.report(wire.Refused("link_clear", refusal, message.seq))
            case wire.LinkLate():
                self._core.console_was_late(message.late_s, now_s)
            case wire.Viewers():
                link.watchers, link.watchers_more = message.watchers, message.more
                link.joints_wanted = message.joints
            case wire.LinkHello():
                self._greet(link, message, now_s)
            case wire.LinkState():
                link.report(wire.Status(self._core.state(now_s, [])))
            case wire.Refresh():
                self._answer(link, message, None)
                self._core.tasks.refresh()
            case wire.LinkQuery():
                self._inspector.ask(link, message)
            case wire.LinkSubscribe(topics=topics):
                self._inspector.set_subscriptions(link, topics)
            case wire.LinkProcess(process=name, wanted=wanted):
                self._served[name].set_wanted(link, wanted)
            case wire.LinkRecord():
                self._recorder.record(message, partial(self._answer, link, message), now_s)
            case wire.LinkRecordEnd(recording=recording):
                self._answer(link, message, self._recorder.end(recording))
            case wire.LinkKeep():
                self._recorder.keep(message, partial(self._answer, link, message))
            case wire.LinkCancel():
                self._answer(link, message, self._core.tasks.cancel(message.what, message.by, now_s))
            case order if isinstance(order, wire.TaskRequest):
                self._take(link, order, now_s)
        return True

    def _drive(self, link: Link, drive: wire.Drive, now_s: float) -> bool:
        if spent := self._drives[link].spend(now_s):
            refusal = self._core.drive(drive, link.number, now_s)
            self._core.decisions.add(time.monotonic() - now_s)
            self._recorder.command(drive, refusal, self._core)
        else:
            refusal = _FLOOD
            self._core.refused[refusal.code] += 1
        if refusal is not None:
            self._refuse(link, wire.Refused("drive", refusal, drive.seq, drive.fence), now_s)
        return spent

    def _velocity(self, link: Link, order: wire.Publish, now_s: float) -> bool:
        """Take a velocity of a stream."""

        def answer(refusal: wire.Refusal | None) -> None:
            if refusal is not None:
                self._refuse(link, wire.Refused(_VELOCITY, refusal, order.seq, order.fence), now_s)

        if spent := self._drives[link].spend(now_s):
            self._begin(order, link, now_s, answer)
            self._core.decisions.add(time.monotonic() - now_s)
        else:
            self._core.refused[_FLOOD.code] += 1
            answer(_FLOOD)
        return spent

    def _take(self, link: Link, order: wire.TaskRequest, now_s: float) -> None:
        self._begin(order, link, now_s, lambda refusal: self._answer(link, order, refusal))

    def _begin(
        self,
        order: wire.TaskRequest,
        link: Link,
        now_s: float,
        answered: Callable[[wire.Refusal | None], None],
    ) -> None:
        """Begin a task. A failed task must not end the link: the views and drives of a whole web process use it."""
        is_open = True

        def answer(refusal: wire.Refusal | None) -> None:
            nonlocal is_open
            if is_open:
                is_open = False
                answered(refusal)

        try:
            self._core.tasks.take(order, link.number, now_s, answer)
        except Exception:
            log.exception("a task failed: %s", wire.kind_of(order))
            answer(_FAULT)

    def _answer(
        self,
        link: Link,
        order: wire.TaskRequest
        | wire.LinkCancel
        | wire.Refresh
        | wire.LinkRecord
        | wire.LinkRecordEnd
        | wire.LinkKeep,
        refusal: wire.Refusal | None,
    ) -> None:
        """Send the one answer to a request."""
        kind, fence = wire.kind_of(order), getattr(order, "fence", None)
        if refusal is None:
            link.report(wire.Accepted(kind, order.seq, fence))
        else:
            self._core.refused[refusal.code] += 1
            self._recorder.refused(refusal, kind)
            link.report(wire.Refused(kind, refusal, order.seq, fence))

    def _stop(self, link: Link, stop: wire.LinkStop, now_s: float) -> None:
        """Stop the robot, unless the message names another robot."""
        if stop.robot is not None and stop.robot != self._robot:
            link.report(wire.Refused(_STOP, OTHER_ROBOT, stop.seq))
            return
        self._core.stop(stop.by, stop.reason, now_s, stop.press, waited=stop.waited)
        self._latch_changed(link, stop.seq, stop.press, now_s)

    def _latch_changed(self, link: Link, seq: int, press: UUID | None, now_s: float) -> None:
        self._lease_orders.save_latch()
        moves = self._core.moves_although_stopped(now_s)
        link.report(wire.Stopped(self._core.stop_state, seq, press, moves))

    def _greet(self, link: Link, hello: wire.LinkHello, now_s: float) -> None:
        link.name = hello.web
        if hello.protocol != wire.PROTOCOL:
            text = say(
                "The web process uses protocol {protocol}, this bridge {own}: restart both.",
                protocol=hello.protocol,
                own=wire.PROTOCOL,
            )
            link.report(wire.Refused("link_hello", wire.Refusal("protocol", text, "wire")))
            link.close_when_sent()
            return
        link.greeted = True
        link.report(wire.Status(self._core.state(now_s, [])))
        link.report(self._core.tasks.capabilities.now())
        link.report(self._core.tasks.navigation.shown_path)

    def _refuse(self, link: Link, refused: wire.Refused, now_s: float) -> None:
        """Answer a refused message, at most every `REFUSAL_GAP_S` for each kind and code."""
        answered, key = self._refused[link], (refused.of, refused.refusal.code)
        if now_s - answered.get(key, float("-inf")) >= REFUSAL_GAP_S:
            answered[key] = now_s
            link.report(refused)
