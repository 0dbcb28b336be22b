"""Subscribes to the topics that programs read, and hands on their messages as bytes.

The side's threads only keep the bytes. One thread asks the robot, and tells what publishers say of themselves.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from msgspec.structs import replace

from robots.bridge.robot.board import BOARD
from robots.bridge.robot_clock import RobotClock
from robots.bridge.served.process import Call
from robots.bridge.tap.arrivals import Arrival, Inbox, Kind, Publisher
from robots.bridge.tap.raw_topic import MOST_PUBLISHERS, RawTopic, Speaker, Take
from robots.bridge.tap.tap_server import TapServer, Wanted
from robots.shared.messages.whole import Encode
from robots.shared.sentences import say
from robots.shared.wire import Form, Refusal, TapState

LOOK_S = 0.5  # between two looks at the publishers
SOON_S = 0.05  # the same while none has answered
SOON_LOOKS = 40  # then the topic has no publisher yet

_NOTHING = Kind("", "")

Listen = Callable[[str, Take, int], RawTopic]  # to a topic, with a queue of so many messages


class _Topic:
    """One subscribed topic."""

    def __init__(self, topic: str, queue: int, inbox: Inbox, listen: Listen) -> None:
        self.topic = topic
        self.looks = 0  # without a publisher
        self.state: TapState | None = None  # the last reported one
        self._inbox = inbox
        self._lock = threading.Lock()
        self._number = 0
        self._kind = _NOTHING  # of the messages that are handed on
        self._publishers: dict[tuple[str, Kind], Publisher] = {}
        self._raw = listen(topic, self._take, queue)

    def close(self) -> None:
        """Unsubscribe."""
        self._raw.close()

    def _take(self, speaker: Speaker, data: bytes) -> None:
        stamp_ns = time.time_ns()
        publisher = self._publisher(speaker)
        with self._lock:
            self._number += 1
            number = self._number
            if self._kind == _NOTHING:
                self._kind = publisher.kind
        if publisher.kind == self._kind:
            self._inbox.put(Arrival(self.topic, publisher, number, stamp_ns, data))

    def _publisher(self, speaker: Speaker) -> Publisher:
        key = speaker.node, speaker.kind
        found = self._publishers.get(key)
        if found is None:
            found = _described(speaker)
            with self._lock:
                if len(self._publishers) >= MOST_PUBLISHERS:
                    self._publishers.clear()
                found = self._publishers[key] = found._replace(number=len(self._publishers))
        return found

    def look(self) -> TapState:
        """Return what the publishers say of themselves now."""
        publishers = [self._publisher(speaker) for speaker in self._raw.speakers()]
        self.looks = 0 if publishers else self.looks + 1
        kinds = list(dict.fromkeys(publisher.kind for publisher in publishers))
        with self._lock:
            if kinds and self._kind not in kinds:
                self._kind = kinds[0]
            kind = self._kind
        if not kinds:
            return TapState(self.topic, refusal=_silence(self.topic))
        own = next(publisher for publisher in publishers if publisher.kind == kind)
        return replace(
            own.state(self.topic),
            latched=any(publisher.latched for publisher in publishers),
            refusal=own.refusal or _discord(kinds, kind) or _too_much(self.topic),
        )


def _described(speaker: Speaker) -> Publisher:
    definition = speaker.definition
    if definition is None:
        return Publisher(0, speaker.kind, speaker.latched, "", {}, speaker.refusal)
    encoders: dict[Form, Encode] = {
        "json": definition.json,
        "cbor": definition.cbor,
    }
    return Publisher(0, speaker.kind, speaker.latched, definition.text, encoders, None)


def _silence(topic: str) -> Refusal:
    text = say("No node publishes on {topic}, or none that can be reached from here.", topic=topic)
    return _too_much(topic) or Refusal("no_publisher", text, "robot")


def _too_much(topic: str) -> Refusal | None:
    why = BOARD.text(topic)
    return Refusal("too_much", why, "robot") if why else None


def _discord(kinds: list[Kind], kind: Kind) -> Refusal | None:
    """Return a refusal if publishers disagree on the type."""
    if len(kinds) < 2:
        return None
    text = say(
        "The publishers of this topic do not agree on the type: only messages of {type} ({md5}) are passed on.",
        type=kind.type,
        md5=kind.md5,
    )
    return Refusal("publishers_differ", text, "robot", {"kinds": len(kinds)})


class Source:
    """All subscriptions at one robot. `call` calls the server on the event loop."""

    def __init__(self, server: TapServer, call: Call, listen: Listen) -> None:
        self.server = server
        self.clock = RobotClock()
        self.looked_s = time.monotonic()
        self._call = call
        self._listen = listen
        self._awake = threading.Condition()
        self._wanted: Wanted = {}
        self._topics: dict[str, _Topic] = {}

    def set_wanted(self, wanted: Wanted) -> None:
        """Set what is read: topic -> longest queue."""
        with self._awake:
            self._wanted = wanted
            self._awake.notify()

    def run(self) -> None:
        """Subscribe and unsubscribe as wanted, without end. This thread asks the robot."""
        while True:
            self.looked_s = time.monotonic()
            with self._awake:
                if self._wanted.keys() == self._topics.keys():
                    self._awake.wait(self._pause_s())
                wanted = self._wanted
            self._follow(wanted)
            for topic in self._topics.values():
                self._look(topic)

    def _pause_s(self) -> float:
        waits = any(0 < topic.looks < SOON_LOOKS for topic in self._topics.values())
        return SOON_S if waits else LOOK_S

    def _follow(self, wanted: Wanted) -> None:
        for name in self._topics.keys() - wanted.keys():
            self.looked_s = time.monotonic()
            self._topics.pop(name).close()
            self._call(self.server.forget, name)
        for name in wanted.keys() - self._topics.keys():
            self.looked_s = time.monotonic()
            self._topics[name] = _Topic(name, wanted[name], self.server.inbox, self._listen)

    def _look(self, topic: _Topic) -> None:
        state = topic.look()
        if 0 < topic.looks < SOON_LOOKS and topic.state is None:
            return  # publishers may still be connecting
        if state != topic.state:
            topic.state = state
            self._call(self.server.report, state)
