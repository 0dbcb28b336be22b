"""Topics that load the robot: subscribed only while a person has control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from robots.bridge.robot.worker import Worker


class Subscription(Protocol):
    """One topic that the bridge listens to."""

    def unregister(self) -> None:
        """End it. Asks the robot."""


class OnDemandSource(Protocol):
    """A group of topics and the handling of their messages."""

    def listen(self) -> Sequence[Subscription]:
        """Subscribe. Asks the robot."""

    def forget(self) -> None:
        """Forget all earlier data: it is no longer valid."""


class OnDemandTopics:
    """Subscribes and unsubscribes on the worker's thread."""

    def __init__(self, worker: Worker, *parts: OnDemandSource) -> None:
        self._worker = worker
        self._parts = parts
        self._wanted = False
        self._subscribers: list[Subscription] = []

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
