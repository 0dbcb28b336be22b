"""Messages as they arrive from publishers, and as they wait on their way to the event loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from robots.shared.messages.packing import Broken, TooLarge
from robots.shared.messages.whole import Encode
from robots.shared.sentences import reason_of, say
from robots.shared.wire import LARGEST_BODY, Form, Refusal, TapState

MOST_KEPT = 200  # messages of a topic that wait for the event loop
MOST_KEPT_BYTES = 32 * 1024 * 1024  # of a topic; one message may be larger
MOST_BYTES = 128 * 1024 * 1024  # of all topics


class Kind(NamedTuple):
    """The type of a topic's messages."""

    type: str
    md5: str


class Publisher(NamedTuple):
    """One publisher of a topic, as its connection describes it."""

    number: int  # differs from those of the topic's other publishers
    kind: Kind
    latched: bool
    definition: str  # empty if it is not known
    encoders: dict[Form, Encode]
    refusal: Refusal | None  # why there are no encoders

    def state(self, topic: str) -> TapState:
        """Return what it says of its topic."""
        return TapState(topic, *self.kind, self.definition, self.latched, self.refusal)


class Undecoded(Exception):
    """A message that cannot be sent in this form; `refusal` has the reason."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class Arrival:
    """One message. It is encoded at most once for each form."""

    def __init__(self, topic: str, publisher: Publisher, number: int, stamp_ns: int, data: bytes) -> None:
        self.topic = topic
        self.publisher = publisher
        self.number = number
        self.stamp_ns = stamp_ns
        self.data = data
        self._bodies: dict[Form, bytes | Refusal] = {}

    def body(self, form: Form) -> bytes:
        """Return the message in this form. Raises Undecoded."""
        body = self._bodies.get(form)
        if body is None:
            body = self._bodies[form] = self._encoded(form)
        if isinstance(body, Refusal):
            raise Undecoded(body)
        return body

    def _encoded(self, form: Form) -> bytes | Refusal:
        if form != "raw" and self.publisher.refusal is not None:
            return self.publisher.refusal
        try:
            body = self.data if form == "raw" else self.publisher.encoders[form](self.data)
        except Broken as error:
            return Refusal("broken", reason_of(error), "robot")
        except TooLarge as error:
            return Refusal("too_large", reason_of(error), "robot")
        if len(body) > LARGEST_BODY:
            text = say(
                "A message has {bytes} bytes in this form; at most {most} are sent.",
                bytes=len(body),
                most=LARGEST_BODY,
            )
            return Refusal("too_large", text, "robot", {"bytes": len(body), "limit_bytes": LARGEST_BODY})
        return body


class Inbox:
    """Keeps the newest messages of each topic until the event loop takes them. `put` may be called on any thread."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._lock = threading.Lock()
        self._waiting: dict[str, deque[Arrival]] = {}
        self._bytes: dict[str, int] = {}

    def put(self, arrival: Arrival) -> None:
        """Keep a message. It replaces the topic's oldest ones if too many wait."""
        with self._lock:
            wakes = not self._waiting
            waiting = self._waiting.setdefault(arrival.topic, deque())
            waiting.append(arrival)
            size = self._bytes.get(arrival.topic, 0) + len(arrival.data)
            most = MOST_KEPT_BYTES if sum(self._bytes.values()) < MOST_BYTES else 0
            while len(waiting) > 1 and (len(waiting) > MOST_KEPT or size > most):
                size -= len(waiting.popleft().data)
            self._bytes[arrival.topic] = size
        if wakes:
            self._wake()

    def take(self) -> list[Arrival]:
        """Return what waits, in the order of arrival for each topic."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
            self._bytes.clear()
        return [arrival for arrivals in waiting.values() for arrival in arrivals]
