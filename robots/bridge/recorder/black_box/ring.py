"""Messages as they arrive, and the ring that keeps those of the last minute. Pure: time is an argument."""

from __future__ import annotations

import heapq
from collections import Counter, deque
from collections.abc import Iterator
from typing import NamedTuple

from robots.shared.messages.type_names import bare

KEPT_S = 60.0
MOST_BYTES = 48 * 1024 * 1024
MOST_LATCHED_BYTES = 8 * 1024 * 1024  # of the latched messages
MOST_GAPS = 10_000  # of lost messages
OVERHEAD_BYTES = 200  # of a message, besides its data
PICTURE_S = 0.5  # between two pictures of a topic
RAW_PICTURE_S = 1.0

_RAW_PICTURES = ("sensor_msgs/Image", "sensor_msgs/PointCloud2", "stereo_msgs/DisparityImage")
_PICTURES = ("sensor_msgs/CompressedImage", "theora_image_transport/Packet", *_RAW_PICTURES)


class Origin(NamedTuple):
    """Where messages come from: a topic as one of its publishers describes it, or the chain (`publisher` empty)."""

    topic: str
    encoding: str  # "ros1", "cdr" (of ROS 2) or "json"
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
    return bare(type_name) in _PICTURES


def picture_gap_s(type_name: str) -> float:
    """Return the least time between two pictures of a topic in the black box."""
    return RAW_PICTURE_S if bare(type_name) in _RAW_PICTURES else PICTURE_S


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


class Latched:
    """The latched messages that hold now: the last one of each publisher. If room is short, the largest go first."""

    def __init__(self) -> None:
        self.size = 0
        self._messages: dict[tuple[str, str], Message] = {}

    def __iter__(self) -> Iterator[Message]:
        return iter(self._messages.values())

    def put(self, message: Message) -> None:
        key = message.origin.topic, message.origin.publisher
        if key in self._messages:
            self._drop(key)
        self._messages[key] = message
        self.size += message.size
        while self.size > MOST_LATCHED_BYTES:
            self._drop(max(self._messages, key=lambda key: self._messages[key].size))

    def _drop(self, key: tuple[str, str]) -> None:
        self.size -= self._messages.pop(key).size


class Ring:
    """The last minute, at most `most_bytes` of it: the oldest pictures go first."""

    def __init__(self, kept_s: float = KEPT_S, most_bytes: int = MOST_BYTES) -> None:
        self._kept_ns = int(kept_s * 1e9)
        self._most_bytes = most_bytes
        self._pictures = _Window()
        self._others = _Window()
        self._newest_picture: dict[str, int] = {}  # by topic: when it came
        self._latched = Latched()
        self._gaps: deque[tuple[int, Origin, int]] = deque(maxlen=MOST_GAPS)

    @property
    def size(self) -> int:
        """Memory of all messages, in bytes."""
        return self._pictures.size + self._others.size + self._latched.size

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
            self._latched.put(message)
        self._drop_old(message.at_ns)
        return True

    def since(self, from_ns: int) -> Iterator[Message]:
        """Yield what came since then, in order; before it, latched messages that still hold."""
        kept = heapq.merge(self._pictures, self._others, key=lambda message: message.at_ns)
        yield from (message for message in self._latched if message.at_ns < from_ns)
        yield from (message for message in kept if message.at_ns >= from_ns)

    def missed(self, origin: Origin, count: int, at_ns: int) -> None:
        """Note messages that were lost before they arrived."""
        self._gaps.append((at_ns, origin, count))

    def missing_since(self, from_ns: int) -> Counter[Origin]:
        """Return how many were lost since then."""
        missing: Counter[Origin] = Counter()
        for at_ns, origin, count in self._gaps:
            if at_ns >= from_ns:
                missing[origin] += count
        return missing

    def _drop_old(self, now_ns: int) -> None:
        for window in (self._pictures, self._others):
            while window and now_ns - window[0].at_ns > self._kept_ns:
                window.drop_oldest()
        while self.size > self._most_bytes and (self._pictures or self._others):
            (self._pictures or self._others).drop_oldest()
