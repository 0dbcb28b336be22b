"""Publishes messages of any type to the robot: once, or repeated at a rate until it is stopped.

The bridge (`robots.bridge.tasks.publishing`) decides whether a message may be published. This module packs and
sends it, under the `PublishPermit` that was valid when the bridge agreed. A halt makes a new permit: queued messages
of the old one are not sent.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from robots.bridge.topics.inspector.side import Node, Writer
from robots.shared.messages.definition import Definition
from robots.shared.processes.vital import start_vital

LISTENERS_S = 1.0  # a topic's first message waits at most this long for listeners to connect
WAITING = 20  # the most messages that wait on one topic
# A topic stays advertised for this time after its last message: the next message need not wait for listeners.
LINGER_S = 10.0
LIFE_S = 0.5  # publishing at a rate needs a sign of life from the bridge within this time

Bytes = Callable[[], bytes]


class PublishPermit:
    """Permission to send, until `withdraw`, which the bridge calls. Sending at a rate also needs a living bridge."""

    def __init__(self) -> None:
        self._sending = threading.Lock()
        self._heard_s = time.monotonic()
        self.ended = False

    def heard(self) -> None:
        """Note a sign of life from the bridge."""
        self._heard_s = time.monotonic()

    def withdraw(self) -> None:
        """End the permission: nothing is sent under it after this returns."""
        with self._sending:
            self.ended = True

    def send(self, send: Callable[[], None], repeated: bool) -> None:
        """Send if the permission holds."""
        with self._sending:
            lives = not repeated or time.monotonic() - self._heard_s < LIFE_S
            if lives and not self.ended:
                send()


class _Publisher:
    """One topic on which this process publishes, with its own thread."""

    def __init__(self, topic: str, definition: Definition, node: Node) -> None:
        self.definition = definition
        self._topic = topic
        self._node = node
        self._once: deque[tuple[Bytes, PublishPermit]] = deque(maxlen=WAITING)
        self._repeated: tuple[Bytes, PublishPermit, float] | None = None  # with the rate (Hz)
        self._news = threading.Condition()
        self._closed = False
        self._thread = start_vital(self._run, f"publish {topic}")

    def say(self, data: Bytes, permit: PublishPermit, rate_hz: float) -> bool:
        """Queue a message. Returns False if the topic is being closed: then the message is not sent."""
        with self._news:
            if rate_hz:
                self._repeated = (data, permit, rate_hz)
            else:
                self._once.append((data, permit))
            self._news.notify()
            return not self._closed

    def stop(self) -> None:
        """Stop sending; drop waiting messages."""
        with self._news:
            self._once.clear()
            self._repeated = None
            self._news.notify()

    def close(self) -> None:
        """Stop sending and unregister the topic."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join()

    def _run(self) -> None:
        writer = self._node.advertise(self._topic, self.definition)
        try:
            writer.await_listeners(LISTENERS_S)
            self._talk(writer)
        finally:
            writer.close()

    def _talk(self, writer: Writer) -> None:
        with self._news:
            while not self._closed:
                while self._once:
                    data, permit = self._once.popleft()
                    permit.send(partial(_send, writer, data), repeated=False)
                if self._repeated is not None:
                    data, permit, rate_hz = self._repeated
                    permit.send(partial(_send, writer, data), repeated=True)
                    self._repeated = None if permit.ended else self._repeated
                    self._news.wait(1.0 / rate_hz)
                elif not self._news.wait(LINGER_S) and not self._once and self._repeated is None:
                    self._closed = True


def _send(writer: Writer, data: Bytes) -> None:
    writer.send(data())


class Publishers:
    """The published topics."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, _Publisher] = {}

    def publish(
        self, topic: str, definition: Definition, data: Bytes, permit: PublishPermit, rate_hz: float
    ) -> None:
        """Send `data()` once (`rate_hz` 0), or at a rate until `stop`, or until the permit ends."""
        talk = self._publishers.get(topic)
        if talk is not None and talk.definition.md5 == definition.md5 and talk.say(data, permit, rate_hz):
            return
        if talk is not None:
            talk.close()
        self._publishers[topic] = _Publisher(topic, definition, self._node)
        self._publishers[topic].say(data, permit, rate_hz)

    def stop(self, topic: str) -> None:
        """Stop sending on this topic."""
        if topic in self._publishers:
            self._publishers[topic].stop()
