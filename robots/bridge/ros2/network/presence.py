"""One bridge per robot: each bridge says twice a second that it is there, and a new one listens before it drives.

DDS knows no clash of names, and two bridges that drive one robot would each send their own velocity. The first one
keeps the robot. A bridge that is silent for `SILENT_S` is gone.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from typing import Any
from uuid import uuid4

import msgspec
from msgspec import Struct
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.texts import TITLE, cut

# After the robot was found, before the first velocity: DDS finds another bridge at about the same time, and it speaks
# twice.
LISTENS_S = 1.2
SILENT_S = 2.0
MOST_OTHERS = 8
QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=4,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


class Word(Struct, frozen=True):
    """The message of a bridge. `process`: an id of its own, since copies of a console have the same names for all."""

    process: str
    host: str
    since_ns: int  # time of day when it took the robot


class Presence:
    """This bridge among others. Words come on the executor's thread."""

    def __init__(self, participant: Participant, topic: str, host: str) -> None:
        self._process, self._host = uuid4().hex, host
        self._began_s: float | None = None  # since when the robot is there
        self._since_ns: int | None = None  # None: it does not drive yet
        self._others: OrderedDict[str, tuple[Word, float]] = OrderedDict()  # by process; when it spoke last
        self._publisher = participant.node.create_publisher(String, topic, QOS)
        participant.listen(topic, "std_msgs/msg/String", self._hear, QOS)

    @property
    def holds(self) -> bool:
        """Return whether this bridge has the robot."""
        return self._since_ns is not None

    def step(self, now_s: float, robot_is_there: bool) -> str | None:
        """Take the robot if nobody has it, and say so. Return the host of the bridge that has it, else None."""
        if robot_is_there:
            self._began_s = self._began_s or now_s
        other = self._first_other(now_s)
        if other is not None and (self._since_ns is None or self._is_before(other)):
            return other.host
        if self._since_ns is None and self._began_s and now_s - self._began_s >= LISTENS_S:
            self._since_ns = time.time_ns()
        if self._since_ns is not None:
            word = Word(self._process, self._host, self._since_ns)
            self._publisher.publish(String(data=msgspec.json.encode(word).decode()))
        return None

    def _is_before(self, other: Word) -> bool:
        return (other.since_ns, other.process) < (self._since_ns, self._process)

    def _first_other(self, now_s: float) -> Word | None:
        words = [word for word, heard_s in list(self._others.values()) if now_s - heard_s < SILENT_S]
        return min(words, key=lambda word: (word.since_ns, word.process), default=None)

    def _hear(self, raw: bytes, _info: Any) -> None:
        message = Cdr(raw)
        word = msgspec.json.decode(bytes(message.data(message.number())).rstrip(b"\0"), type=Word)
        if word.process != self._process:
            word = Word(cut(word.process, TITLE), cut(word.host, TITLE), word.since_ns)
            self._others[word.process] = word, time.monotonic()
            self._others.move_to_end(word.process)
            while len(self._others) > MOST_OTHERS:
                self._others.popitem(last=False)
