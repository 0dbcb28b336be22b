"""Messages of a robot's topics to those who look: each gets the newest when it has drawn the last, never a queue."""

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

from robots.wire import MOST_SUBSCRIPTIONS, Refusal
from teleop.live.picture_feed import Send

log = logging.getLogger(__name__)

MAX_SUBSCRIPTIONS = 8  # of one connection


class Withheld(Exception):
    """A message is not sent now; a newer one may be."""


@dataclass
class Subscription:
    """A topic as one connection looks at it."""

    rate_hz: float
    shown: int = 0  # number of the last message sent
    due_s: float = 0.0  # no message before


class TopicViewer:
    """One connection's looks. Of each topic at most one message is on its way to it, and none is kept for it.

    Messages are acknowledged in the order in which they were sent.
    """

    def __init__(self, looks: TopicFeed, send: Send) -> None:
        self.at: dict[str, Subscription] = {}
        self.news = asyncio.Event()
        self._looks = looks
        self._send = send
        self._on_way: deque[str] = deque()
        self._task = asyncio.create_task(self._keep_showing())
        looks.viewers.add(self)

    def look(self, topic: str, rate_hz: float) -> Refusal | None:
        """Look at a topic from now on, or at another rate. Returns why not, if there are too many."""
        if topic not in self.at:
            if len(self.at) >= MAX_SUBSCRIPTIONS:
                text = f"At most {MAX_SUBSCRIPTIONS} topics are shown at once: close one first."
                return Refusal("too_many_looks", text, "wire", {"topic": topic, "limit": MAX_SUBSCRIPTIONS})
            if topic not in self._looks.wanted and len(self._looks.wanted) >= MOST_SUBSCRIPTIONS:
                text = f"{MOST_SUBSCRIPTIONS} topics of this robot are shown to people already: more are not possible."
                return Refusal("too_many_looks", text, "wire", {"topic": topic, "limit": MOST_SUBSCRIPTIONS})
        self.at[topic] = Subscription(rate_hz)
        self.news.set()  # somebody else may look already: then the newest is there
        self._looks.changed()
        return None

    def look_away(self, topic: str) -> None:
        """Look at a topic no more."""
        if self.at.pop(topic, None):
            self._looks.changed()

    def drawn(self) -> None:
        """The oldest message that is on its way was drawn."""
        if self._on_way:
            self._on_way.popleft()
            self.news.set()

    def leave(self) -> None:
        """Look at nothing any more."""
        self._task.cancel()
        self._looks.viewers.discard(self)
        self._looks.changed()

    async def _keep_showing(self) -> None:
        while True:
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self.news.wait(), self._pause_s())
            self.news.clear()
            for topic in list(self.at):
                if self._is_ready(topic) and self.at[topic].due_s <= time.monotonic():
                    try:
                        await self._show(topic)
                    except OSError:
                        return  # it is gone; its own connection notices
                    except Exception:
                        log.exception("a message of %s was not sent", topic)

    def _pause_s(self) -> float | None:
        """Until the next message is due; None while there is none to show."""
        due_s = min((look.due_s for topic, look in self.at.items() if self._is_ready(topic)), default=None)
        return None if due_s is None else max(due_s - time.monotonic(), 0.0)

    def _is_ready(self, topic: str) -> bool:
        """Whether there is a message to show, and its last one was drawn."""
        look = self.at.get(topic)
        if look is None or topic in self._on_way or len(self._on_way) >= MAX_SUBSCRIPTIONS:
            return False
        return self._looks.number(topic) > look.shown

    async def _show(self, topic: str) -> None:
        look = self.at[topic]
        look.shown, message = self._looks.newest[topic]
        look.due_s = time.monotonic() + 1.0 / look.rate_hz
        self._on_way.append(topic)
        try:
            await self._send(message)
        except Withheld:
            self._on_way.remove(topic)


class TopicFeed:
    """The newest message of each topic of one robot that somebody here looks at.

    `tell` is told what all together want, and at which rate, whenever that changes.
    """

    def __init__(self, tell: Callable[[Mapping[str, float]], None]) -> None:
        self.newest: dict[str, tuple[int, dict[str, Any]]] = {}
        self.wanted: dict[str, float] = {}
        self.viewers: set[TopicViewer] = set()
        self._tell = tell
        self._numbers = count(1)

    def number(self, topic: str) -> int:
        """Of the newest message; 0: none came."""
        return self.newest[topic][0] if topic in self.newest else 0

    def publish(self, topic: str, shown: str) -> None:
        """Make `shown` the newest message of a topic."""
        if topic not in self.wanted:
            return
        self.newest[topic] = next(self._numbers), {"type": "websocket.send", "text": shown}
        for viewer in self.viewers:
            if topic in viewer.at:
                viewer.news.set()

    def forget(self) -> None:
        """What came is not the robot's present any more."""
        self.newest.clear()

    def changed(self) -> None:
        """Somebody looks at something else."""
        wanted: dict[str, float] = {}
        for viewer in self.viewers:
            for topic, look in viewer.at.items():
                wanted[topic] = max(look.rate_hz, wanted.get(topic, 0.0))
        if wanted != self.wanted:
            self.wanted = wanted
            self.newest = {topic: newest for topic, newest in self.newest.items() if topic in wanted}
            self._tell(wanted)
