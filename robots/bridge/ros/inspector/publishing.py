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

import rospy

from robots.bridge.ros.inspector.definitions import Definition
from robots.bridge.ros.tasks.publishing import immediate_publisher, publish
from robots.shared.processes.vital import start_vital
from robots.shared.ros.master import Master, MasterError

LISTENERS_S = 1.0  # a topic's first message waits at most this long for listeners to connect
WAITING = 20  # the most messages that wait on one topic
# A topic stays advertised for this time after its last message: the next message need not wait for listeners.
LINGER_S = 10.0
LIFE_S = 0.5  # publishing at a rate needs a sign of life from the bridge within this time
# a subscriber that does not read for this time is disconnected, so that it delays no other
SEND_PATIENCE_S = 0.3

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

    def __init__(self, topic: str, definition: Definition, master: Master) -> None:
        self.definition = definition
        self._topic = topic
        self._master = master
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
        """Stop sending and unregister from the master."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join()

    def _run(self) -> None:
        publisher = immediate_publisher(self._topic, _message_class(self.definition), SEND_PATIENCE_S)
        try:
            self._await_listeners(publisher)
            self._talk(publisher)
        finally:
            publisher.unregister()

    def _await_listeners(self, publisher: rospy.Publisher) -> None:
        """Wait for listeners: they miss messages that are sent before they are connected."""
        deadline_s = time.monotonic() + LISTENERS_S
        try:
            known = len(self._master.system_state().subscribers.get(self._topic, []))
        except MasterError:
            return
        while publisher.get_num_connections() < known and time.monotonic() < deadline_s:
            time.sleep(0.01)

    def _talk(self, publisher: rospy.Publisher) -> None:
        with self._news:
            while not self._closed:
                while self._once:
                    data, permit = self._once.popleft()
                    permit.send(partial(_send, publisher, data), repeated=False)
                if self._repeated is not None:
                    data, permit, rate_hz = self._repeated
                    permit.send(partial(_send, publisher, data), repeated=True)
                    self._repeated = None if permit.ended else self._repeated
                    self._news.wait(1.0 / rate_hz)
                elif not self._news.wait(LINGER_S) and not self._once and self._repeated is None:
                    self._closed = True


def _send(publisher: rospy.Publisher, data: Bytes) -> None:
    publish(publisher, publisher.data_class().deserialize(data()))


class Publishers:
    """The published topics."""

    def __init__(self, master: Master) -> None:
        self._master = master
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
        self._publishers[topic] = _Publisher(topic, definition, self._master)
        self._publishers[topic].say(data, permit, rate_hz)

    def stop(self, topic: str) -> None:
        """Stop sending on this topic."""
        if topic in self._publishers:
            self._publishers[topic].stop()


def _message_class(definition: Definition) -> type[rospy.AnyMsg]:
    """Return a message class with the attributes that rospy needs; this module packs the bytes."""
    names = {
        "_type": definition.type,
        "_md5sum": definition.md5,
        "_full_text": definition.text,
        "__slots__": [],
    }
    return type("Message", (rospy.AnyMsg,), names)
