"""Samples of a robot's topics for its viewers.

A viewer gets the newest sample of a topic after it acknowledged the previous one. Samples are never queued.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

from robots.shared.sentences import say
from robots.shared.wire import MOST_SUBSCRIPTIONS, Refusal
from teleop.live.view_feed import Send

log = logging.getLogger(__name__)

MAX_SUBSCRIPTIONS = 8  # per connection


class SampleWithheld(Exception):
    """Raised by `send`: this sample must not be sent now. A newer one may be."""


@dataclass
class Subscription:
    """One connection's subscription to one topic."""

    rate_hz: float  # at most so many samples per second
    shown: int = 0  # number of the last sample sent
    due_s: float = 0.0  # monotonic time before which no sample is sent


class TopicViewer:
    """One connection's subscriptions.

    At most one sample of each topic is unacknowledged, and no sample is stored for a connection. Acknowledgements
    arrive in the order in which samples were sent.
    """

    def __init__(self, feed: TopicFeed, send: Send) -> None:
        self.subscriptions: dict[str, Subscription] = {}
        self.news = asyncio.Event()
        self._feed = feed
        self._send = send
        self._unacknowledged: deque[str] = deque()
        self._task = asyncio.create_task(self._keep_showing())
        feed.viewers.add(self)

    def subscribe(self, topic: str, rate_hz: float) -> Refusal | None:
        """Subscribe to a topic, or change the rate. Returns a refusal if there are too many subscriptions."""
        if topic not in self.subscriptions:
            if len(self.subscriptions) >= MAX_SUBSCRIPTIONS:
                text = say(
                    "At most {most} topics are shown at once: close one first.", most=MAX_SUBSCRIPTIONS
                )
                return Refusal(
                    "too_many_subscriptions", text, "wire", {"topic": topic, "limit": MAX_SUBSCRIPTIONS}
                )
            if topic not in self._feed.rates_hz and len(self._feed.rates_hz) >= MOST_SUBSCRIPTIONS:
                text = say(
                    "People already watch {most} topics of this robot. No more are possible.",
                    most=MOST_SUBSCRIPTIONS,
                )
                return Refusal(
                    "too_many_subscriptions", text, "wire", {"topic": topic, "limit": MOST_SUBSCRIPTIONS}
                )
        self.subscriptions[topic] = Subscription(rate_hz)
        self.news.set()  # if another connection has subscribed already, the newest sample is here
        self._feed.changed()
        return None

    def unsubscribe(self, topic: str) -> None:
        """End the subscription to a topic."""
        if self.subscriptions.pop(topic, None):
            self._feed.changed()

    def acknowledge(self) -> None:
        """Note that the client has shown the oldest unacknowledged sample."""
        if self._unacknowledged:
            self._unacknowledged.popleft()
            self.news.set()

    def leave(self) -> None:
        """End all subscriptions."""
        self._task.cancel()
        self._feed.viewers.discard(self)
        self._feed.changed()

    async def _keep_showing(self) -> None:
        while self in self._feed.viewers:  # before Python 3.12, `wait_for` may lose a cancellation
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self.news.wait(), self._pause_s())
            self.news.clear()
            for topic in list(self.subscriptions):
                if self._is_ready(topic) and self.subscriptions[topic].due_s <= time.monotonic():
                    try:
                        await self._show(topic)
                    except OSError:
                        return  # the connection is gone; its consumer detects this itself
                    except Exception:
                        log.exception("A sample of %s was not sent.", topic)

    def _pause_s(self) -> float | None:
        """Return the time until the next sample is due; None while there is no sample to send."""
        due_s = min(
            (
                subscription.due_s
                for topic, subscription in self.subscriptions.items()
                if self._is_ready(topic)
            ),
            default=None,
        )
        return None if due_s is None else max(due_s - time.monotonic(), 0.0)

    def _is_ready(self, topic: str) -> bool:
        """Return whether there is a new sample and the previous one is acknowledged."""
        subscription = self.subscriptions.get(topic)
        if (
            subscription is None
            or topic in self._unacknowledged
            or len(self._unacknowledged) >= MAX_SUBSCRIPTIONS
        ):
            return False
        return self._feed.number(topic) > subscription.shown

    async def _show(self, topic: str) -> None:
        subscription = self.subscriptions[topic]
        subscription.shown, message = self._feed.newest[topic]
        subscription.due_s = time.monotonic() + 1.0 / subscription.rate_hz
        self._unacknowledged.append(topic)
        try:
            await self._send(message)
        except SampleWithheld:
            self._unacknowledged.remove(topic)


class TopicFeed:
    """The newest sample of each topic of one robot to which a connection of this web process subscribes.

    The feed calls `request` with all subscribed topics and their rates (Hz) when these change.
    """

    def __init__(self, request: Callable[[Mapping[str, float]], None]) -> None:
        self.newest: dict[str, tuple[int, dict[str, Any]]] = {}
        self.rates_hz: dict[str, float] = {}
        self.viewers: set[TopicViewer] = set()
        self._request = request
        self._numbers = count(1)

    def number(self, topic: str) -> int:
        """Return the number of the newest sample of a topic; 0: none arrived."""
        return self.newest[topic][0] if topic in self.newest else 0

    def publish(self, topic: str, sample: str) -> None:
        """Make `sample` the newest sample of a topic."""
        if topic not in self.rates_hz:
            return
        self.newest[topic] = next(self._numbers), {"type": "websocket.send", "text": sample}
        for viewer in self.viewers:
            if topic in viewer.subscriptions:
                viewer.news.set()

    def clear(self) -> None:
        """Delete all samples: the robot is out of reach, so they are too old."""
        self.newest.clear()

    def changed(self) -> None:
        """Combine the subscriptions of all viewers; the highest rate of a topic counts."""
        rates_hz: dict[str, float] = {}
        for viewer in self.viewers:
            for topic, subscription in viewer.subscriptions.items():
                rates_hz[topic] = max(subscription.rate_hz, rates_hz.get(topic, 0.0))
        if rates_hz != self.rates_hz:
            self.rates_hz = rates_hz
            self.newest = {topic: newest for topic, newest in self.newest.items() if topic in rates_hz}
            self._request(rates_hz)
