"""Messages as they arrive, and the ring that keeps those of the last minute. Pure: time is an argument."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

KEPT_S = 60.0
MOST_BYTES = 48 * 1024 * 1024
MOST_LATCHED_BYTES = 8 * 1024 * 1024  # of the latched messages; a larger one is not kept
OVERHEAD_BYTES = 200  # of a message, besides its data
PICTURE_S = 0.5  # between two pictures of a topic
RAW_PICTURE_S = 1.0

_RAW_PICTURES = ("sensor_msgs/Image", "sensor_msgs/PointCloud2", "stereo_msgs/DisparityImage")
_PICTURES = ("sensor_msgs/CompressedImage", "theora_image_transport/Packet", *_RAW_PICTURES)


class Origin(NamedTuple):
    """Where messages come from: a topic as one of its publishers describes it, or the chain (`publisher` empty)."""

    topic: str
    encoding: str  # "ros1" or "json"
    type: str  # of ROS, or the name of a schema
    md5: str
    definition: str  # text of the message definition, or a JSON schema
    publisher: str = ""
    latched: bool = False

    @property
    def is_picture(self) -> bool:
        """Return whether these messages are pictures or clouds: large, and many."""
        return is_picture(self.type)


def is_picture(type_name: str) -> bool:
    """Return whether messages of this type are pictures or clouds."""
    return type_name in _PICTURES


def picture_gap_s(type_name: str) -> float:
    """Return the least time between two pictures of a topic in the black box."""
    return RAW_PICTURE_S if type_name in _RAW_PICTURES else PICTURE_S


class Message(NamedTuple):
    """One message. `at_ns`: its arrival on the monotonic clock, which all processes of a computer share."""

    origin: Origin
    number: int
    at_ns: int
    data: bytes

    @property
    def size(self) -> int:
        """Return the memory that it takes, roughly."""
        return len(self.data) + OVERHEAD_BYTES


class _Window(deque[Message]):
    """Messages in the order of their arrival, with their total size."""

    size = 0

    def put(self, message: Message) -> None:
        self.append(message)
        self.size += message.size

    def drop_oldest(self) -> None:
        self.size -= self.popleft().size


class Ring:
    """The last minute, at most `most_bytes` of it: the oldest pictures go first."""

    def __init__(self, kept_s: float = KEPT_S, most_bytes: int = MOST_BYTES) -> None:
        self._kept_ns = int(kept_s * 1e9)
        self._most_bytes = most_bytes
        self._pictures = _Window()
        self._others = _Window()
        self._newest_picture: dict[str, int] = {}  # by topic: when it came
        self._latched: dict[tuple[str, str], Message] = {}
        self._latched_bytes = 0

    @property
    def size(self) -> int:
        """Memory of all messages, in bytes."""
        return self._pictures.size + self._others.size + self._latched_bytes

    def held_s(self, now_ns: int) -> int:
        """Return how much of the past it holds, in whole seconds."""
        firsts = [window[0].at_ns for window in (self._others, self._pictures) if window]
        return (now_ns - min(firsts)) // 10**9 if firsts else 0

    def put(self, message: Message) -> bool:
        """Keep a message. Return False for a picture that comes too soon after the last one, which is not kept."""
        origin = message.origin
        if origin.is_picture:
            last_ns = self._newest_picture.get(origin.topic)
            if last_ns is not None and message.at_ns - last_ns < 0.9e9 * picture_gap_s(origin.type):
                return False
            self._newest_picture[origin.topic] = message.at_ns
            self._pictures.put(message)
        else:
            self._others.put(message)
        if origin.latched:
            self._latch(message)
        self._drop_old(message.at_ns)
        return True

    def since(self, from_ns: int) -> Iterator[Message]:
        """Yield what came since then, in order; before it, latched messages that still hold."""
        kept = heapq.merge(self._pictures, self._others, key=lambda message: message.at_ns)
        yield from (message for message in self._latched.values() if message.at_ns < from_ns)
        yield from (message for message in kept if message.at_ns >= from_ns)

    def clear(self) -> None:
        """Forget everything but latched messages."""
        self._pictures, self._others = _Window(), _Window()
        self._newest_picture.clear()

    def forget(self, topics: set[str]) -> None:
        """Forget the latched messages of all other topics: they are not read any more."""
        for key in [key for key in self._latched if key[0] not in topics]:
            self._unlatch(key)

    def _latch(self, message: Message) -> None:
        key = message.origin.topic, message.origin.publisher
        if key in self._latched:
            self._unlatch(key)
        self._latched[key] = message
        self._latched_bytes += message.size
        while self._latched_bytes > MOST_LATCHED_BYTES:
            self._unlatch(next(iter(self._latched)))

    def _unlatch(self, key: tuple[str, str]) -> None:
        self._latched_bytes -= self._latched.pop(key).size

    def _drop_old(self, now_ns: int) -> None:
        for window in (self._pictures, self._others):
            while window and now_ns - window[0].at_ns > self._kept_ns:
                window.drop_oldest()
        while self.size > self._most_bytes and (self._pictures or self._others):
            (self._pictures or self._others).drop_oldest()
