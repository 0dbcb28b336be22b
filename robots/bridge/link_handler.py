"""Decode, check and answer each message of a link.

Nothing here waits: a stop is never queued behind other work. A link may send 200 commands a second, far more than a
stick sends. Each further command is dropped in its own turn of the event loop, so that ticks, stops and sensors keep
their turns.
"""

from __future__ import annotations

import asyncio
import logging
import time
from uuid import UUID

from robots import wire
from robots.bridge.core import Core
from robots.bridge.lease.fencing import FenceStore
from robots.bridge.server.flood_limits import Budget
from robots.bridge.server.link_server import Link
from robots.bridge.topics.inspector_client import InspectorClient

log = logging.getLogger(__name__)

DRIVES_PER_S = 200.0  # what a page may send at most; a stick sends 20 to 50
DRIVES_AT_ONCE = 50.0
REFUSAL_GAP_S = 0.25  # a link's refused messages of one kind and code are answered this often

_STOP = "link_stop"
OTHER_ROBOT = wire.Refusal("other_robot", "This is another robot’s bridge: it was not stopped.", "robot")
_FLOOD = wire.Refusal(
    "flood", f"More than {DRIVES_PER_S:.0f} commands a second.", "wire", {"limit_per_s": DRIVES_PER_S}
)
_FAULT = wire.Refusal(
    "bridge_fault",
    "The bridge failed at this; its log says how. Whether it was carried out is not known.",
    "robot",
)


class LinkHandler:
    """The door of one bridge."""

    def __init__(self, core: Core, leasing: FenceStore, inspector: InspectorClient) -> None:
        self._core = core
        self._robot = UUID(core.config.robot_id)
        self._leasing = leasing
        self._inspector = inspector
        self._drives: dict[Link, Budget] = {}
        self._refused: dict[Link, dict[tuple[str, str], float]] = {}  # when last, by kind and code

    def opened(self, link: Link) -> None:
        """The first word to a web process: whose bridge this is, and nothing that the robot told."""
        self._drives[link] = Budget(DRIVES_PER_S, DRIVES_AT_ONCE)
        self._refused[link] = {}
        link.report(self._core.hello())

    def closed(self, link: Link) -> None:
        """A web process is gone: what was controlled through it stops."""
        self._core.link_lost(link.number, time.monotonic())
        self._leasing.forget(link)
        self._inspector.forget(link)
        del self._drives[link], self._refused[link]

    async def received(self, link: Link, raw: bytes) -> None:
        """One message of the WebSocket."""
        if not self.hear(link, raw):
            await asyncio.sleep(0)

    def hear(self, link: Link, raw: bytes) -> bool:
        """One message, by whichever way. False: it was dropped, as one of a flood."""
        now_s = time.monotonic()
        try:
            message = wire.link_request(raw)
        except wire.WireError as error:
            kind, seq = wire.heading(raw)
            if kind == _STOP:  # a stop is never refused for its form
                self._stop(link, wire.LinkStop("somebody", "the message was damaged", seq or 0), now_s)
                return True
            self._core.refused[error.refusal.code] += 1
            self._refuse(link, wire.Refused("link", error.refusal), now_s)
            return True
        match message:
            case wire.Drive():
                return self._drive(link, message, now_s)
            case wire.Grant() | wire.Revoke() | wire.Pause():
                self._leasing.hear(link, message)
            case wire.LinkStop():
                self._stop(link, message, now_s)
            case wire.LinkClear():
                refusal = self._core.clear(message.number, now_s, message.presses)
                if refusal is None:
                    self._latch_changed(link, message.seq)
                    log.info("stop %d was cleared by %s", message.number, message.by)
                else:
                    link.report(wire.Refused("link_clear", refusal, message.seq))
            case wire.LinkLate():
                self._core.console_was_late(message.late_s, now_s)
            case wire.Viewers():
                link.watchers, link.watchers_more = message.watchers, message.more
            case wire.LinkHello():
                self._greet(link, message, now_s)
            case wire.Refresh():
                self._answer(link, message, None)
                self._core.tasks.refresh()
            case wire.LinkQuery():
                self._inspector.ask(link, message)
            case wire.LinkSubscribe(topics=topics):
                self._inspector.look_at(link, topics)
            case wire.LinkCancel():
                self._answer(link, message, self._core.tasks.cancel(message.what, message.by))
            case order if isinstance(order, wire.TaskRequest):
                self._take(link, order, now_s)
        return True

    def _drive(self, link: Link, drive: wire.Drive, now_s: float) -> bool:
        if spent := self._drives[link].spend(now_s):
            refusal = self._core.drive(drive, link.number, now_s)
        else:
            refusal = _FLOOD
            self._core.refused[refusal.code] += 1
        if refusal is not None:
            self._refuse(link, wire.Refused("drive", refusal, drive.seq, drive.fence), now_s)
        return spent

    def _take(self, link: Link, order: wire.TaskRequest, now_s: float) -> None:
        """One order's fault is not the end of a link: pictures and drives of a whole web process come over it."""
        is_open = True

        def answer(refusal: wire.Refusal | None) -> None:
            nonlocal is_open
            if is_open:
                is_open = False
                self._answer(link, order, refusal)

        try:
            self._core.tasks.take(order, link.number, now_s, answer)
        except Exception:
            log.exception("an order broke: %s", wire.kind_of(order))
            answer(_FAULT)

    def _answer(
        self,
        link: Link,
        order: wire.TaskRequest | wire.LinkCancel | wire.Refresh,
        refusal: wire.Refusal | None,
    ) -> None:
        """The one answer that an order gets."""
        kind, fence = wire.kind_of(order), getattr(order, "fence", None)
        if refusal is None:
            link.report(wire.Accepted(kind, order.seq, fence))
        else:
            self._core.refused[refusal.code] += 1
            link.report(wire.Refused(kind, refusal, order.seq, fence))

    def _stop(self, link: Link, stop: wire.LinkStop, now_s: float) -> None:
        """The emergency stop, unless another robot is meant."""
        if stop.robot is not None and stop.robot != self._robot:
            link.report(wire.Refused(_STOP, OTHER_ROBOT, stop.seq))
            return
        self._core.stop(stop.by, stop.reason, now_s, stop.press, waited=stop.waited)
        self._latch_changed(link, stop.seq, stop.press)

    def _latch_changed(self, link: Link, seq: int, press: UUID | None = None) -> None:
        self._leasing.save_latch()
        link.report(wire.Stopped(self._core.stop_state, seq, press))

    def _greet(self, link: Link, hello: wire.LinkHello, now_s: float) -> None:
        link.name = hello.web
        if hello.protocol != wire.PROTOCOL:
            text = f"The web process speaks protocol {hello.protocol}, this bridge {wire.PROTOCOL}: restart both."
            link.report(wire.Refused("link_hello", wire.Refusal("protocol", text, "wire")))
            link.end()
            return
        link.greeted = True
        link.report(wire.Status(self._core.state(now_s, [])))
        link.report(self._core.tasks.capabilities.now())

    def _refuse(self, link: Link, refused: wire.Refused, now_s: float) -> None:
        """Answer, but not thirty times a second."""
        answered, key = self._refused[link], (refused.of, refused.refusal.code)
        if now_s - answered.get(key, float("-inf")) >= REFUSAL_GAP_S:
            answered[key] = now_s
            link.report(refused)
