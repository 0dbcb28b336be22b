"""The bridge's client of its inspector. The process runs only while somebody needs it.

Queries and subscriptions of all links go in; answers and samples come out and go to the links that asked
(`robots.bridge.topics.inspector_messages`). The control loop passes bytes, decodes no ROS message and never waits.
"""

from __future__ import annotations

import asyncio
import logging
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import msgspec
from msgspec import Struct

from robots import wire
from robots.bridge.config import BridgeConfig
from robots.bridge.topics.inspector_messages import (
    Check,
    Done,
    HaltPublishing,
    InspectorQuery,
    KeepAlive,
    Ready,
    Report,
    Request,
)
from robots.bridge.topics.line_process import LineProcess
from robots.wire import MOST_SUBSCRIPTIONS, Refusal

log = logging.getLogger(__name__)

COMMAND = (sys.executable, "-m", "robots.bridge.ros.inspector")
LINGER_S = 60.0  # an inspector that nobody needs ends after this
ANSWER_S = 2.0  # a question is answered within this, or refused
START_S = 10.0  # the same, while the process still starts
SILENCE_S = 1.0  # a publishing ends within this, or the process does
MOST_ASKED = 32  # questions of one link under way
MOST_UNSENT = 200  # requests, while there is no process


_report = msgspec.json.Decoder(Report)

_SILENT = Refusal("inspector_silent", "The robot’s inspector did not answer in time: ask again.", "robot")
_NOT_KNOWN = Refusal(
    "inspector_silent",
    "The robot’s inspector did not answer in time: whether it was carried out is not known.",
    "robot",
)


class InspectorViewer(Protocol):
    """A viewer of topics: a `Link`."""

    def report(self, message: Struct) -> None:
        """Queue an answer."""

    def see(self, topic: str, seen: bytes) -> None:
        """Make this the topic's next message; an older one not yet sent is dropped."""


class _Waiting:
    """Something that the inspector was asked, and who wants to know."""

    def __init__(
        self,
        viewer: InspectorViewer | None,
        answer: Callable[[Any], None],
        timer: asyncio.TimerHandle,
        silence: Refusal,
    ) -> None:
        self.viewer = viewer
        self.answer = answer  # with a `Refusal`, or what the report holds
        self.timer = timer
        self.silence = silence  # the answer if there is none


class InspectorClient:
    """The inspector of one robot. Lives on the event loop; `lost` is called when what was published ended by itself."""

    def __init__(
        self,
        config: BridgeConfig,
        lost: Callable[[], None],
        command: Sequence[str] = COMMAND,
        linger_s: float = LINGER_S,
    ) -> None:
        self._helper = LineProcess(command, msgspec.json.encode(config), self)
        self._lost = lost
        self._linger_s = linger_s
        self._looks: dict[InspectorViewer, Mapping[str, float]] = {}
        self._talking: set[str] = set()  # topics that are published on at a rate
        self._has_published = False  # since the last halt: it may still wait there
        self._waiting: dict[int, _Waiting] = {}
        self._count = 0
        self._unsent: dict[int, bytes] = {}  # by number, until the process is there
        self._ready = False
        self._idle: asyncio.TimerHandle | None = None

    async def close(self) -> None:
        """The bridge ends."""
        for waiting in self._waiting.values():
            waiting.timer.cancel()
        if self._idle is not None:
            self._idle.cancel()
        await self._helper.close()

    # --- who looks -----------------------------------------------------------------------------------

    def ask(self, viewer: InspectorViewer, inspect: wire.LinkQuery) -> None:
        """A question; its answer is reported to the viewer within `ANSWER_S`."""

        def answer(given: msgspec.Raw | Refusal) -> None:
            if isinstance(given, Refusal):
                refused = wire.Refused(wire.kind_of(inspect.ask), given, inspect.ask.seq)
                given = msgspec.Raw(wire.encode(refused))
            viewer.report(wire.LinkAnswer(inspect.seq, given))

        if sum(waiting.viewer is viewer for waiting in self._waiting.values()) >= MOST_ASKED:
            text = f"More than {MOST_ASKED} questions at once: wait for the answers."
            answer(Refusal("busy", text, "wire", {"limit": MOST_ASKED}))
            return
        acts = isinstance(inspect.ask, wire.SetParameter | wire.CallService)
        within_s = self._patience_s
        number = self._expect(viewer, answer, within_s, _NOT_KNOWN if acts else _SILENT)
        self._ask(number, InspectorQuery(number, inspect.ask, time.monotonic() + within_s))

    def look_at(self, viewer: InspectorViewer, topics: Mapping[str, float]) -> None:
        """Exactly these topics are looked at through this viewer now, each at so many messages a second."""
        before = self._wanted()
        self._looks[viewer] = topics
        self._look_anew(before)
        for topic in topics.keys() - self._wanted().keys():
            viewer.see(topic, _not_shown(topic))

    def forget(self, viewer: InspectorViewer) -> None:
        """The viewer is gone."""
        before = self._wanted()
        self._looks.pop(viewer, None)
        for number in [number for number, waiting in self._waiting.items() if waiting.viewer is viewer]:
            self._waiting.pop(number).timer.cancel()
            self._unsent.pop(number, None)
        self._look_anew(before)

    # --- what is published (`robots.bridge.tasks.publishing.Publisher`) --------------------------------------

    def check(self, order: wire.Publish, then: Callable[[Refusal | None, float], None]) -> None:
        """Whether the fields fit the definition; `then` is called once, with what does not, and the time."""
        number = self._expect(None, lambda given: then(given, time.monotonic()), self._patience_s)
        self._ask(number, Check(number, order))

    def publish(self, order: wire.Publish) -> bool:
        """Send it now, or from now on. False: there is no process that would; it is not sent later either."""
        if not self._send(order):
            log.warning("the inspector is gone: nothing is published on %s", order.topic)
            return False
        self._has_published = True
        if order.rate_hz:
            self._talking.add(order.topic)
        return True

    def keep_alive(self) -> None:
        """Allow repeated publications for another `LIFE_S`."""
        if self._talking:
            self._send(KeepAlive())

    def publish_stop(self, topic: str) -> None:
        """Send no more there. A process that does not say so in time is killed."""
        if topic in self._talking:
            self._talking.discard(topic)
            self._silence(topic)

    def halt(self) -> None:
        """Send nothing of what was given until now, also of what waits. The same for who does not say so in time."""
        if self._has_published:
            self._has_published = False
            self._talking.clear()
            self._silence(None)

    def _silence(self, topic: str | None) -> None:
        if self._helper.lives:
            number = self._expect(None, self._silent, SILENCE_S)
            self._send(HaltPublishing(number, topic))

    def _silent(self, given: Refusal | None) -> None:
        if given is not None:
            self._helper.kill("it does not stop publishing")

    # --- the process (helper.Partner) -------------------------------------------------------------------

    def needed(self) -> bool:
        """While somebody looks or publishes, and for a while after a question."""
        return bool(self._wanted() or self._talking or self._waiting or self._idle)

    def began(self) -> None:
        """It is told what is looked at, and asked what waits."""
        self._ready = False
        self._send(wire.LinkSubscribe(self._wanted()))
        if self._unsent:
            self._helper.send(b"\n".join(self._unsent.values()))
            self._unsent.clear()

    def hear(self, line: bytes) -> None:
        """An answer, or a message."""
        match _report.decode(line):
            case wire.LinkSample(topic=topic):
                seen = line.rstrip()  # as it came: the link's report is the same
                for viewer, topics in self._looks.items():
                    if topic in topics:
                        viewer.see(topic, seen)
            case wire.LinkAnswer(seq=number, answer=raw):
                self._answer(number, raw)
            case Done(number=number, refusal=refusal):
                self._answer(number, refusal)
            case Ready():
                self._ready = True

    def ended(self) -> None:
        """The inspector ended, and all publications with it. None restarts by itself."""
        self._ready = self._has_published = False
        if self._talking:
            self._talking.clear()
            self._lost()

    # --- inside -----------------------------------------------------------------------------------------

    @property
    def _patience_s(self) -> float:
        """How long an answer may take."""
        return ANSWER_S if self._ready and self._helper.listens else START_S

    def _expect(
        self,
        viewer: InspectorViewer | None,
        answer: Callable[[Any], None],
        within_s: float,
        silence: Refusal = _SILENT,
    ) -> int:
        """A number whose answer goes to `answer`: `silence`, if there is none in time."""
        self._need()
        self._count += 1
        timer = asyncio.get_running_loop().call_later(within_s, partial(self._give_up, self._count))
        self._waiting[self._count] = _Waiting(viewer, answer, timer, silence)
        return self._count

    def _give_up(self, number: int) -> None:
        """No answer came in time. A request that was not sent is dropped, and its asker is told so."""
        unsent = self._unsent.pop(number, None)
        self._answer(number, self._waiting[number].silence if unsent is None else _SILENT)

    def _answer(self, number: int, given: Any) -> None:
        waiting = self._waiting.pop(number, None)
        if waiting is not None:  # else too late
            waiting.timer.cancel()
            waiting.answer(given)

    def _wanted(self) -> dict[str, float]:
        """The topics that anybody looks at, first come first served, with the highest rate."""
        wanted: dict[str, float] = {}
        for topics in self._looks.values():
            for topic, rate_hz in topics.items():
                if topic in wanted or len(wanted) < MOST_SUBSCRIPTIONS:
                    wanted[topic] = max(rate_hz, wanted.get(topic, 0.0))
        return wanted

    def _look_anew(self, before: dict[str, float]) -> None:
        wanted = self._wanted()
        if wanted != before:
            self._need()
            self._send(wire.LinkSubscribe(wanted))  # one that is not there yet is told when it starts

    def _ask(self, number: int, request: InspectorQuery | Check) -> None:
        """Send it now, or once there is a process."""
        if self._helper.listens:
            self._send(request)
        elif len(self._unsent) < MOST_UNSENT:
            self._unsent[number] = wire.encode(request)

    def _send(self, request: Request) -> bool:
        """To the process that is there now; what concerns publishing is for no other. False: none hears it."""
        return self._helper.send(wire.encode(request))

    def _need(self) -> None:
        """Have a process, for another while."""
        if self._idle is not None:
            self._idle.cancel()
        self._idle = asyncio.get_running_loop().call_later(self._linger_s, self._end_if_idle)
        self._helper.need()

    def _end_if_idle(self) -> None:
        self._idle = None
        if not self.needed():
            self._helper.let_go()


def _not_shown(topic: str) -> bytes:
    text = f"{MOST_SUBSCRIPTIONS} topics of this robot are looked at already: close some, here or on other pages."
    refusal = Refusal("too_many_looks", text, "robot", {"limit": MOST_SUBSCRIPTIONS})
    shown = wire.Sample(topic, "*", 0, None, 0, None, 0, {}, refusal=refusal)
    return wire.encode(wire.LinkSample(topic, msgspec.Raw(wire.encode(shown))))
