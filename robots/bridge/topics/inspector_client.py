"""The bridge's client of its inspector: a process that runs only while somebody watches, asks or publishes.

The client passes queries and subscriptions of all links to the inspector, and answers and samples back to the
links that requested them (`robots.bridge.topics.inspector_messages`). It handles bytes only: the control loop
decodes no ROS message and waits for nothing.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import msgspec

from robots.bridge.robot_clock import RobotClock
from robots.bridge.server.link_server import Link
from robots.bridge.topics.inspector_messages import (
    Check,
    Done,
    FollowClock,
    HaltPublishing,
    InspectorQuery,
    KeepAlive,
    Ready,
    Report,
    Request,
)
from robots.bridge.topics.line_process import LineProcess
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import side_command
from robots.shared.sentences import say
from robots.shared.wire import MOST_SUBSCRIPTIONS, Refusal

log = logging.getLogger(__name__)

LINGER_S = 60.0  # an unused inspector ends after this time
ANSWER_S = 2.0  # a query is answered within this time, or refused
START_S = 10.0  # the same while the process starts
NOTICED_S = 0.05  # by which the robot's clock changes before the process is told
HALT_S = 1.0  # publishing stops within this time, or the process is killed
MAX_QUERIES = 32  # limit of pending queries per link
MAX_UNSENT = 200  # limit of requests that wait for a process


_report = msgspec.json.Decoder(Report)

_SILENT = Refusal("inspector_silent", "The robot’s inspector did not answer in time: ask again.", "robot")
_NOT_KNOWN = Refusal(
    "inspector_silent",
    "The robot’s inspector did not answer in time: it is unknown whether this was carried out.",
    "robot",
)


@dataclass(frozen=True)
class _Waiting:
    """A request to the inspector."""

    viewer: Link | None
    answer: Callable[[Any], None]  # called with a `Refusal`, or with the report's content
    timer: asyncio.TimerHandle
    unanswered: Refusal  # passed to `answer` if no answer arrives in time


class InspectorClient:
    """The inspector of one robot, on the event loop. `lost` is called if it ends while it publishes at a rate."""

    def __init__(
        self,
        config: BridgeConfig,
        lost: Callable[[], None],
        command: Sequence[str] = (),
        linger_s: float = LINGER_S,
    ) -> None:
        self._child = LineProcess(
            command or side_command(config.ros, "inspector"), msgspec.json.encode(config), self
        )
        self._lost = lost
        self._linger_s = linger_s
        self._subscriptions: dict[Link, Mapping[str, float]] = {}
        self._at_rate: set[str] = set()  # topics published at a rate
        self._has_published = False  # since the last halt: messages may still wait in the inspector
        self._waiting: dict[int, _Waiting] = {}
        self._clock = RobotClock()
        self._count = 0
        self._unsent: dict[int, bytes] = {}  # by number, until the process runs
        self._ready = False
        self._idle: asyncio.TimerHandle | None = None

    async def close(self) -> None:
        """End the process: the bridge ends."""
        for waiting in self._waiting.values():
            waiting.timer.cancel()
        if self._idle is not None:
            self._idle.cancel()
        await self._child.close()

    # --- subscriptions and queries ----------------------------------------------------------------

    def ask(self, viewer: Link, inspect: wire.LinkQuery) -> None:
        """Send a query; its answer is reported to the viewer within `ANSWER_S`."""

        def answer(given: msgspec.Raw | Refusal) -> None:
            if isinstance(given, Refusal):
                refused = wire.Refused(wire.kind_of(inspect.ask), given, inspect.ask.seq)
                given = msgspec.Raw(wire.encode(refused))
            viewer.report(wire.LinkAnswer(inspect.seq, given))

        if sum(waiting.viewer is viewer for waiting in self._waiting.values()) >= MAX_QUERIES:
            text = say("More than {most} queries at once: wait for the answers.", most=MAX_QUERIES)
            answer(Refusal("busy", text, "wire", {"limit": MAX_QUERIES}))
            return
        acts = isinstance(inspect.ask, wire.SetParameter | wire.DeleteParameter | wire.CallService)
        within_s = self._patience_s
        number = self._expect(viewer, answer, within_s, _NOT_KNOWN if acts else _SILENT)
        self._ask(number, InspectorQuery(number, inspect.ask, time.monotonic() + within_s))

    def set_subscriptions(self, viewer: Link, topics: Mapping[str, float]) -> None:
        """Set this viewer's subscriptions to exactly these topics, each with its rate in messages a second."""
        before = self._wanted()
        self._subscriptions[viewer] = topics
        self._resubscribe(before)
        for topic in topics.keys() - self._wanted().keys():
            viewer.show_sample(topic, _not_shown(topic))

    def forget(self, viewer: Link) -> None:
        """Forget a viewer that is gone."""
        before = self._wanted()
        self._subscriptions.pop(viewer, None)
        for number in [number for number, waiting in self._waiting.items() if waiting.viewer is viewer]:
            self._waiting.pop(number).timer.cancel()
            self._unsent.pop(number, None)
        self._resubscribe(before)

    # --- publishing (`robots.bridge.tasks.task.Publisher`) ----------------------------------

    def check(self, order: wire.Publish, then: Callable[[Refusal | None, float], None]) -> None:
        """Check the fields against the definition; call `then` once, with a refusal or None, and the time."""
        number = self._expect(None, lambda given: then(given, time.monotonic()), self._patience_s)
        self._ask(number, Check(number, order))

    def publish(self, order: wire.Publish) -> bool:
        """Publish once, or at a rate from now on.

        Return False if there is no process; then the message is not sent later either.
        """
        if not self._send(order):
            log.warning("the inspector ended: no message is published on %s", order.topic)
            return False
        self._has_published = True
        if order.rate_hz:
            self._at_rate.add(order.topic)
        return True

    def keep_alive(self) -> None:
        """Allow publishing at a rate to continue for the inspector's `LIFE_S`."""
        if self._at_rate:
            self._send(KeepAlive())

    def follow_clock(self, clock: RobotClock) -> None:
        """Tell the process of the robot's clock, when that has changed noticeably."""
        if clock.differs(self._clock, NOTICED_S):
            self._clock = clock
            self._send(FollowClock(clock))

    def publish_stop(self, topic: str) -> None:
        """Stop publishing on this topic. The process is killed if it does not confirm in time."""
        if topic in self._at_rate:
            self._at_rate.discard(topic)
            self._stop_publishing(topic)

    def halt(self) -> None:
        """Stop all publishing that was requested until now, and drop waiting messages.

        The process is killed if it does not confirm in time.
        """
        if self._has_published:
            self._has_published = False
            self._at_rate.clear()
            self._stop_publishing(None)

    def _stop_publishing(self, topic: str | None) -> None:
        if self._child.lives:
            number = self._expect(None, self._confirmed, HALT_S)
            self._send(HaltPublishing(number, topic))

    def _confirmed(self, given: Refusal | None) -> None:
        if given is not None:
            self._child.kill("it did not confirm that publishing stopped")

    # --- the process (line_process.LineProcessOwner) ----------------------------------------------

    def needed(self) -> bool:
        """Return whether to keep the process: subscriptions, publishing, or a recent query."""
        return bool(self._wanted() or self._at_rate or self._waiting or self._idle)

    def began(self) -> None:
        """Send a new process the subscriptions and the waiting requests."""
        self._ready = False
        if self._clock != RobotClock():
            self._send(FollowClock(self._clock))
        self._send(wire.LinkSubscribe(self._wanted()))
        if self._unsent:
            self._child.send(b"\n".join(self._unsent.values()))
            self._unsent.clear()

    def handle_line(self, line: bytes) -> None:
        """Take an answer or a sample."""
        match _report.decode(line):
            case wire.LinkSample(topic=topic):
                sample = line.rstrip()  # unchanged: the link's report has the same bytes
                for viewer, topics in self._subscriptions.items():
                    if topic in topics:
                        viewer.show_sample(topic, sample)
            case wire.LinkAnswer(seq=number, answer=raw):
                self._answer(number, raw)
            case Done(number=number, refusal=refusal):
                self._answer(number, refusal)
            case Ready():
                self._ready = True

    def ended(self) -> None:
        """Note that the process ended: its publications ended too, and none begins again by itself."""
        self._ready = self._has_published = False
        if self._at_rate:
            self._at_rate.clear()
            self._lost()

    # --- inside -----------------------------------------------------------------------------------------

    @property
    def _patience_s(self) -> float:
        """Return the time limit (s) of an answer."""
        return ANSWER_S if self._ready and self._child.listens else START_S

    def _expect(
        self,
        viewer: Link | None,
        answer: Callable[[Any], None],
        within_s: float,
        unanswered: Refusal = _SILENT,
    ) -> int:
        """Return a new request's number. `answer` gets its answer, or `unanswered` if none comes in time."""
        self._need()
        self._count += 1
        timer = asyncio.get_running_loop().call_later(within_s, partial(self._give_up, self._count))
        self._waiting[self._count] = _Waiting(viewer, answer, timer, unanswered)
        return self._count

    def _give_up(self, number: int) -> None:
        """Answer a request that timed out. A request that was never sent was certainly not carried out."""
        unsent = self._unsent.pop(number, None)
        self._answer(number, self._waiting[number].unanswered if unsent is None else _SILENT)

    def _answer(self, number: int, given: Any) -> None:
        waiting = self._waiting.pop(number, None)
        if waiting is not None:  # else the answer is too late
            waiting.timer.cancel()
            waiting.answer(given)

    def _wanted(self) -> dict[str, float]:
        """Return the subscribed topics of all viewers, first come first served, each with its highest rate."""
        wanted: dict[str, float] = {}
        for topics in self._subscriptions.values():
            for topic, rate_hz in topics.items():
                if topic in wanted or len(wanted) < MOST_SUBSCRIPTIONS:
                    wanted[topic] = max(rate_hz, wanted.get(topic, 0.0))
        return wanted

    def _resubscribe(self, before: dict[str, float]) -> None:
        wanted = self._wanted()
        if wanted != before:
            self._need()
            self._send(wire.LinkSubscribe(wanted))  # a process that starts later gets them in `began`

    def _ask(self, number: int, request: InspectorQuery | Check) -> None:
        """Send the request now, or when a process runs."""
        if self._child.listens:
            self._send(request)
        elif len(self._unsent) < MAX_UNSENT:
            self._unsent[number] = wire.encode(request)

    def _send(self, request: Request) -> bool:
        """Send to the present process. Publishing must not reach a later process. Return False if none takes it."""
        return self._child.send(wire.encode(request))

    def _need(self) -> None:
        """Keep a process for another `linger_s`."""
        if self._idle is not None:
            self._idle.cancel()
        self._idle = asyncio.get_running_loop().call_later(self._linger_s, self._end_if_idle)
        self._child.need()

    def _end_if_idle(self) -> None:
        self._idle = None
        if not self.needed():
            self._child.close_input()


def _not_shown(topic: str) -> bytes:
    text = say(
        "{most} topics of this robot are open already: close some, here or on other pages.",
        most=MOST_SUBSCRIPTIONS,
    )
    refusal = Refusal("too_many_subscriptions", text, "robot", {"limit": MOST_SUBSCRIPTIONS})
    sample = wire.Sample(topic, "*", 0, None, 0, None, 0, {}, refusal=refusal)
    return wire.encode(wire.LinkSample(topic, msgspec.Raw(wire.encode(sample))))
