"""The live view: the newest message of each subscribed topic, decoded in part, at the requested rate.

The node's threads only keep the newest bytes and count messages. One thread decides which topics are due, and decodes
only those: a topic of 100 Hz that is shown five times a second is decoded five times a second.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
from msgspec.structs import replace

from robots.bridge.robot.board import BOARD
from robots.bridge.robot_clock import RobotClock
from robots.bridge.topics.inspector.declined import Declined
from robots.bridge.topics.inspector.side import Node, Received, Talker
from robots.shared import wire
from robots.shared.messages.definition import Definition
from robots.shared.messages.packing import Broken, Detail, TooLarge
from robots.shared.processes.vital import start_vital
from robots.shared.sentences import reason_of, say

log = logging.getLogger(__name__)

LARGEST_SHOWN = 16 * 1024  # bytes of a `Sample`
LEVELS = (Detail(32, 16, 500), Detail(8, 4, 100), Detail(2, 1, 40))  # of detail; the first that fits is shown
AGAIN_S = 1.0  # until a topic without a new message is reported again: for its figures, and for new viewers
LONGEST_NAME = 200  # characters of a publisher's own name
MOST_NAMED = 20  # publishers of a topic
RATE_WINDOW_S = 10.0
RATE_LEAST = 3  # messages: if fewer are in the window, the rate is that of the last `RATE_LEAST` messages
RATE_SAMPLES = 2000

_encode = msgspec.json.Encoder().encode


class Subscription:
    """One subscribed topic."""

    def __init__(self, topic: str, rate_hz: float, awake: threading.Condition, node: Node) -> None:
        self.topic = topic
        self.gap_s = 1.0 / rate_hz
        # So the first message is shown at once, and a silent topic is reported after a while.
        self.shown_s = time.monotonic() - self.gap_s
        self._awake = awake
        self._arrivals: deque[float] = deque(maxlen=RATE_SAMPLES)
        self._newest: Received | None = None
        self._number = 0
        self._shown_number = 0
        self._source = node.subscribe(topic, self._on_message)

    def close(self) -> None:
        """Unsubscribe."""
        self._source.close()

    def _on_message(self, message: Received) -> None:
        self._arrivals.append(time.monotonic())
        with self._awake:
            self._newest = message
            self._number += 1
            self._awake.notify()

    def due_s(self) -> float:
        """Return when the topic is due: when its rate allows after a new message, else after `AGAIN_S`."""
        fresh = self._number != self._shown_number
        return self.shown_s + (self.gap_s if fresh else max(self.gap_s, AGAIN_S))

    def show(self, now_s: float, clock: RobotClock) -> bytes:
        """Return the present `Sample`."""
        with self._awake:
            message, number = self._newest, self._number
        self.shown_s, self._shown_number = now_s, number
        talkers, arrivals = self._source.talkers(), list(self._arrivals.copy())
        known = [talker.type for talker in talkers if talker.type is not None]
        shown = wire.Sample(
            self.topic,
            known[0][:LONGEST_NAME] if known else "*",
            number,
            rate_hz(arrivals, now_s),
            0,
            None,
            len(talkers),
            {},
            refusal=self._source.refusal() or _silence(self.topic, number, len(talkers)) or _discord(talkers),
            publisher_names=_names(talkers),
            since_s=round(max(now_s - arrivals[-1], 0.0), 3) if arrivals else None,
        )
        if message is None:
            return _encode(shown)
        shown = replace(shown, type=message.type[:LONGEST_NAME], bytes=len(message.data))
        try:
            return _filled(shown, message.definition(), message.data, clock)
        except Declined as error:
            return _encode(replace(shown, refusal=error.refusal))
        except Broken as error:
            return _encode(replace(shown, refusal=wire.Refusal("broken", reason_of(error), "robot")))


def rate_hz(arrivals: Sequence[float], now_s: float) -> float | None:
    """Return messages a second: over the last seconds, or over the last few messages of a slow topic.

    None for fewer than two messages; 0 if the topic has been silent for much longer than its rate allows.
    """
    recent = [arrival_s for arrival_s in arrivals if arrival_s > now_s - RATE_WINDOW_S]
    if len(recent) < RATE_LEAST:
        recent = list(arrivals[-RATE_LEAST:])
    if len(recent) < 2 or recent[-1] == recent[0]:
        return None
    gap_s = (recent[-1] - recent[0]) / (len(recent) - 1)
    is_silent = now_s - recent[-1] > max(RATE_WINDOW_S, RATE_LEAST * gap_s)
    return 0.0 if is_silent else round(1.0 / gap_s, 3)


def _names(talkers: Sequence[Talker]) -> list[str]:
    """Return the publishers' names, as they send them."""
    return sorted({talker.name[:LONGEST_NAME] for talker in talkers})[:MOST_NAMED]


def _discord(talkers: Sequence[Talker]) -> wire.Refusal | None:
    """Return a refusal if publishers disagree on the type. Each message has its publisher's definition."""
    kinds = sorted({f"{one.type} ({one.md5})"[:LONGEST_NAME] for one in talkers if one.type is not None})
    if len(kinds) < 2:
        return None
    text = say("Its publishers do not agree on the type: {kinds}.", kinds=", ".join(kinds[:MOST_NAMED]))
    return wire.Refusal("publishers_differ", text, "robot", {"kinds": len(kinds)})


def _filled(shown: wire.Sample, definition: Definition, data: bytes, clock: RobotClock) -> bytes:
    """Encode with as much detail as fits."""
    for detail in LEVELS:
        try:
            fields, shortened = definition.layout.read(data, detail)
        except TooLarge:
            continue
        encoded = _encode(replace(shown, fields=fields, shortened=shortened, age_s=_age_s(fields, clock)))
        if len(encoded) <= LARGEST_SHOWN:
            return encoded
    text = say("A message of {type} has too many fields to be shown.", type=shown.type)
    return _encode(replace(shown, refusal=wire.Refusal("too_large", text, "robot")))


def _age_s(fields: Mapping[str, Any], clock: RobotClock) -> float | None:
    """Return the time since the message's stamp, by the robot's clock; None: not known."""
    header = fields.get("header")
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict):
        return None
    seconds, nanoseconds = stamp.values()
    age_s = clock.age_s(seconds + nanoseconds * 1e-9, time.time())
    return None if age_s is None else round(age_s, 3)


def _silence(topic: str, number: int, publishers: int) -> wire.Refusal | None:
    if why := BOARD.text(topic):
        return wire.Refusal("too_much", why, "robot")
    if publishers == 0:
        text = (
            say("No node publishes on {topic} any more, or none that can be reached from here.", topic=topic)
            if number
            else say("No node publishes on {topic}, or none that can be reached from here.", topic=topic)
        )
        return wire.Refusal("no_publisher", text, "robot")
    if number == 0:
        return wire.Refusal("no_message", say("No message has come on {topic} yet.", topic=topic), "robot")
    return None


class Subscriptions:
    """All subscriptions. `send` passes on a topic and its `Sample`; while it blocks, no message is decoded."""

    def __init__(self, node: Node, send: Callable[[str, bytes], None]) -> None:
        self._node = node
        self._send = send
        self.clock = RobotClock()
        self._wanted: Mapping[str, float] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._awake = threading.Condition()
        start_vital(self._run, "looks")

    def set_subscriptions(self, topics: Mapping[str, float]) -> None:
        """Set the subscriptions: topic -> most messages a second."""
        with self._awake:
            self._wanted = topics
            self._awake.notify()

    def _run(self) -> None:
        while True:
            try:
                self._subscribe()
                self._show_due(time.monotonic())
            except Exception:  # one bad topic must not end the view of the others
                log.exception("a topic cannot be shown")
            with self._awake:
                if self._wanted.keys() == self._subscriptions.keys():
                    due_s = min((look.due_s() for look in self._subscriptions.values()), default=None)
                    self._awake.wait(None if due_s is None else max(due_s - time.monotonic(), 0.0))

    def _show_due(self, now_s: float) -> None:
        for look in self._subscriptions.values():
            if look.due_s() <= now_s:
                self._send(look.topic, look.show(now_s, self.clock))

    def _subscribe(self) -> None:
        """Subscribe and unsubscribe as wanted. Runs on this thread, since it may wait for the robot."""
        with self._awake:
            wanted = self._wanted
        for topic in self._subscriptions.keys() - wanted.keys():
            self._subscriptions.pop(topic).close()
        for topic, rate_hz in wanted.items():
            if topic in self._subscriptions:
                self._subscriptions[topic].gap_s = 1.0 / rate_hz
            else:
                self._subscriptions[topic] = Subscription(topic, rate_hz, self._awake, self._node)
