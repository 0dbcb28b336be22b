"""Whose messages are looked at through one link, by all its followers together."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

F = TypeVar("F")

PACE_S = 0.1  # people change their minds faster than a robot should have to follow


class Looking(Generic[F]):
    """Gathers what followers want. `tell` is told soon after a change, and says whether it could pass that on."""

    def __init__(self, tell: Callable[[], bool]) -> None:
        self._wanted: dict[F, Mapping[str, float]] = {}
        self._tell = tell
        self._due: asyncio.TimerHandle | None = None

    @property
    def topics(self) -> dict[str, float]:
        """Each topic, with the highest rate that anybody wants (Hz)."""
        topics: dict[str, float] = {}
        for wanted in self._wanted.values():
            for topic, rate_hz in wanted.items():
                topics[topic] = max(rate_hz, topics.get(topic, 0.0))
        return topics

    def want(self, follower: F, topics: Mapping[str, float]) -> None:
        """Exactly these topics are what `follower` wants from now on."""
        before = self.topics
        if topics:
            self._wanted[follower] = dict(topics)
        else:
            self._wanted.pop(follower, None)
        if self.topics != before and self._due is None:
            self._tell_soon()

    def who_wants(self, topic: str) -> list[F]:
        """The followers that look at a topic."""
        return [follower for follower, wanted in self._wanted.items() if topic in wanted]

    def close(self) -> None:
        """Tell no more."""
        if self._due is not None:
            self._due.cancel()

    def _tell_soon(self) -> None:
        self._due = asyncio.get_running_loop().call_later(PACE_S, self._tell_now)

    def _tell_now(self) -> None:
        self._due = None
        if not self._tell():
            self._tell_soon()
