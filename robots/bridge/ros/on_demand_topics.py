"""Topics that load the robot: subscribed only while a person has control."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import rospy

from robots.bridge.robot.worker import Worker
from robots.bridge.ros.bounds.sizes import expect

BUFFER_BYTES = 1 << 20  # of one read; a picture has some hundred kilobytes to some megabytes


def listen(
    topic: str, type_name: str, take: Callable[[bytes], None], queue: int | None = None
) -> rospy.Subscriber:
    """Subscribe to a topic of this type; `take` gets the bytes of each message, on a rospy thread."""
    expect(topic, type_name)
    return rospy.Subscriber(
        topic,
        rospy.AnyMsg,
        lambda message: take(message._buff),
        queue_size=queue,
        buff_size=BUFFER_BYTES,
        tcp_nodelay=True,
    )


class OnDemandSource(Protocol):
    """A group of topics and the handling of their messages."""

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe. Calls the master."""

    def forget(self) -> None:
        """Forget all earlier data: it is no longer valid."""


class OnDemandTopics:
    """Subscribes and unsubscribes on the worker's thread."""

    def __init__(self, worker: Worker, *parts: OnDemandSource) -> None:
        self._worker = worker
        self._parts = parts
        self._wanted = False
        self._subscribers: list[rospy.Subscriber] = []

    def set_wanted(self, wanted: bool) -> None:
        """Subscribe while wanted, else unsubscribe. Returns at once."""
        if wanted != self._wanted:
            self._wanted = wanted
            self._worker.do(self._follow)

    def _follow(self) -> None:
        if self._wanted and not self._subscribers:
            for part in self._parts:
                # Added per part: if the next part raises, this one is still unsubscribed when control ends.
                self._subscribers += part.listen()
        elif not self._wanted and self._subscribers:
            leaving, self._subscribers = self._subscribers, []
            for subscriber in leaving:
                subscriber.unregister()
            for part in self._parts:
                part.forget()
