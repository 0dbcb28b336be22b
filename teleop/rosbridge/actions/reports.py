"""Reports of the robot about a goal: feedback and result, under the bridge's id for it.

The bridge's own ids begin with `GOAL_PREFIX`. One client has control, and an action has one goal at a time, so
the newest goal of this client for the action is the one that is meant.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import msgspec
from msgspec import Struct

from robots.link.tap_link import STARTING
from robots.shared.wire import GOAL_PREFIX, Form, TapState
from teleop.rosbridge.family import Client
from teleop.tap.feed import TapMessage, TapReader, feed_of

PARTS = ("feedback", "result")
QUEUE = 20  # messages of a part that may wait
READY_S = 2.0  # the longest wait for the tap before the first goal of an action

Heard = Callable[[str, str, dict[str, Any]], Awaitable[None]]


class _GoalId(Struct):
    id: str = ""


class _Status(Struct):
    goal_id: _GoalId


class _Report(Struct):
    """An action's feedback or result."""

    status: _Status
    feedback: dict[str, Any] = {}
    result: dict[str, Any] = {}


_decode = msgspec.json.Decoder(_Report).decode


class Reports:
    """Reads feedback and result of actions for one client; `heard` gets action, part and its fields."""

    def __init__(self, client: Client, heard: Heard) -> None:
        self._client = client
        self._heard = heard
        self._reader: TapReader | None = None
        self._described: dict[str, asyncio.Event] = {}  # by topic: its publisher has answered

    async def listen(self, action: str) -> None:
        """Read an action from now on; return when its server has answered, or after `READY_S`."""
        link = self._client.hub.link
        if self._reader is None or self._reader.feed.link is not link:
            self.leave()
            self._reader = TapReader(feed_of(link), self._deliver, self._state, lambda: False)
        for topic in (f"{action}/{part}" for part in PARTS):
            if topic not in self._described:
                self._described[topic] = asyncio.Event()
                self._reader.read(topic, "json", queue=QUEUE)
        described = (self._described[f"{action}/{part}"].wait() for part in PARTS)
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.gather(*described), READY_S)

    def leave(self) -> None:
        """Read no more."""
        if self._reader is not None:
            self._reader.leave()
        self._described.clear()

    def _state(self, state: TapState) -> None:
        answered = state.type or state.refusal not in (None, STARTING)
        if answered and state.topic in self._described:
            self._described[state.topic].set()

    async def _deliver(self, topic: str, _form: Form, message: TapMessage) -> None:
        try:
            report = _decode(message.body)
        except msgspec.DecodeError:
            return
        if report.status.goal_id.id.startswith(GOAL_PREFIX):
            action, _, part = topic.rpartition("/")
            await self._heard(action, part, report.feedback if part == "feedback" else report.result)
