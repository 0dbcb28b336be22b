"""Subscribes to the topics that are recorded, and hands on their messages as bytes, each with its definition."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from typing import Protocol

from robots.bridge.recorder.black_box.contacts import reports_contact
from robots.bridge.recorder.black_box.ring import Message, Origin, is_picture
from robots.bridge.recorder.recorder import Wanted
from robots.bridge.tap.arrivals import Kind
from robots.bridge.tap.raw_topic import RawTopic, Speaker, Take
from robots.shared.graph import SystemState, is_own
from robots.shared.messages.packing import HEADER
from robots.shared.unreachable import Unreachable
from robots.shared.wire import MOST_RECORDED_TOPICS

log = logging.getLogger(__name__)

# Between two looks for new topics; a robot's bumpers are there from its start
_SURVEY_S = {"": None, "all": 2.0, "pictures_not": 2.0, "contacts": 20.0}
MOST_MISSED = 10_000  # a larger gap between the numbers of messages is none
_UNREAD = ("/rosout_agg",)  # the same messages as /rosout


class Receiver(Protocol):
    """A taker of messages, on any thread."""

    def arrived(self, message: Message) -> None: ...

    def missed(self, origin: Origin, count: int) -> None: ...

    def left_out(self, count: int) -> None: ...


class RecorderSide(Protocol):
    """A robot's topics, as a ROS side reads them."""

    encoding: str  # of messages: "ros1" or "cdr"

    def listen(self, topic: str, take: Take, *, thins: bool) -> RawTopic:
        """Subscribe. `thins`: few of these messages are kept, and they are large; only the newest matters."""

    def survey(self) -> SystemState:
        """Return the present publishers. Raises Unreachable."""

    def leave(self) -> None:
        """Leave the robot."""


class _Topic:
    """One subscribed topic."""

    def __init__(self, topic: str, gap_s: float, side: RecorderSide, to: Receiver) -> None:
        self.topic = topic
        self.gap_s = gap_s
        self._to = to
        self._lock = threading.Lock()
        self._number = 0
        self._origins: dict[tuple[str, Kind], Origin] = {}
        self._sent: dict[Origin, int] = {}  # by the publisher's own count
        self._encoding = side.encoding
        self._raw = side.listen(topic, self._on_message, thins=bool(gap_s))

    def close(self) -> None:
        """Unsubscribe."""
        self._raw.close()

    def _on_message(self, speaker: Speaker, data: bytes) -> None:
        at_ns = time.monotonic_ns()
        origin = self._origins.get((speaker.node, speaker.kind))
        if origin is None:
            origin = self._origins[speaker.node, speaker.kind] = _origin(self.topic, self._encoding, speaker)
        with self._lock:
            self._number += 1
            number = self._number
        if not self.gap_s and _counts(speaker):
            self._count_missed(origin, data)
        self._to.arrived(Message(origin, number, at_ns, data))

    def _count_missed(self, origin: Origin, data: bytes) -> None:
        """Count messages that the publisher sent and that never came: it drops those that are not read in time.

        Each publisher of ROS 1 numbers the headers of its messages without a gap.
        """
        sent, before = int.from_bytes(data[:4], "little"), self._sent.get(origin)
        self._sent[origin] = sent
        if before is not None and 0 < (missed := sent - before - 1) < MOST_MISSED:
            self._to.missed(origin, missed)


def _counts(speaker: Speaker) -> bool:
    """Return whether messages begin with a header that is numbered, as in ROS 1."""
    fields = speaker.definition.fields if speaker.definition is not None else []
    if not fields or fields[0].type != HEADER or fields[0].array is not None:
        return False
    return fields[0].fields[0].name == "seq"


def _origin(topic: str, encoding: str, speaker: Speaker) -> Origin:
    # A definition that does not fit its md5 sum is kept as its publisher sent it: a reader may know better
    text = speaker.definition.text if speaker.definition is not None else speaker.text
    return Origin(
        topic, encoding, speaker.kind.type, speaker.kind.md5, text, speaker.node or "?", speaker.latched
    )


class Reading:
    """All subscriptions at one robot; lives on its own thread, which asks the robot."""

    def __init__(self, side: RecorderSide, to: Receiver) -> None:
        self._side = side
        self._to = to
        self._awake = threading.Condition()
        self._wanted = Wanted({})
        self._changed = False
        self._topics: dict[str, _Topic] = {}

    def follow(self, wanted: Wanted) -> None:
        """Set what is read. Thread-safe; returns at once."""
        with self._awake:
            self._wanted = wanted
            self._changed = True
            self._awake.notify()

    def run(self) -> None:
        """Subscribe and unsubscribe as wanted, without end."""
        while True:
            with self._awake:
                if not self._changed:
                    self._awake.wait(_SURVEY_S[self._wanted.others])
                self._changed = False
                wanted = self._wanted
            self._read(dict(wanted.topics) | (self._others(wanted) if wanted.others else {}))

    def _others(self, wanted: Wanted) -> dict[str, float]:
        """Return the further topics that have a publisher of the robot, the small ones first if they are too many."""
        try:
            state = self._side.survey()
        except Unreachable as error:
            log.warning("the robot's topics are not known: %s", error)
            return dict.fromkeys(self._topics.keys() - wanted.topics.keys(), 0.0)
        found = [
            topic
            for topic, nodes in sorted(state.publishers.items())
            if topic not in _UNREAD and any(not is_own(node) for node in nodes)
        ]
        if wanted.others == "contacts":
            found = [topic for topic in found if reports_contact(topic, state.types.get(topic, ""))]
        pictures = {topic for topic in found if is_picture(state.types.get(topic, ""))}
        if wanted.others == "pictures_not":
            found = [topic for topic in found if topic not in pictures]
        found.sort(key=lambda topic: topic in pictures)
        room = MOST_RECORDED_TOPICS - len(wanted.topics)
        more = [topic for topic in found if topic not in wanted.topics]
        self._to.left_out(len(more[room:]))
        return dict.fromkeys(more[:room], 0.0)

    def _read(self, wanted: Mapping[str, float]) -> None:
        for name in list(self._topics):
            # a queue is set at the subscription
            if name not in wanted or bool(wanted[name]) != bool(self._topics[name].gap_s):
                self._topics.pop(name).close()
        for name, gap_s in wanted.items():
            if name not in self._topics:
                self._topics[name] = _Topic(name, gap_s, self._side, self._to)
