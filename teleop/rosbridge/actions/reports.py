"""Reports of the robot about a goal: feedback and result, under the bridge's id for it.

The bridge's own ids begin with `GOAL_PREFIX`. One client has control, and an action has one goal at a time, so
the newest goal of this client for the action is the one that is meant.
"""

from __future__ import annotations

import asyncio
import base64
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from typing import Any

import msgspec
from msgspec import Struct

from robots.link.tap_link import STARTING
from robots.shared.wire import GOAL_MARK, GOAL_PREFIX, Form, TapState
from teleop.rosbridge.actions.translation import FEEDBACK
from teleop.rosbridge.family import Client
from teleop.tap.feed import TapMessage, TapReader, feed_of

QUEUE = 20  # messages of a part that may wait
READY_S = 2.0  # the longest wait for the tap before the first goal of an action

Heard = Callable[[str, str, dict[str, Any]], Awaitable[None]]


class _GoalId(Struct):
    id: str = ""


class _Status(Struct):
    goal_id: _GoalId


class _Uuid(Struct, frozen=True):
    uuid: str = ""  # base64


class _Report(Struct):
    """An action's feedback or result; with ROS 2 only feedback, by `goal_id`."""

    status: _Status | None = None
    goal_id: _Uuid = _Uuid()
    feedback: dict[str, Any] = {}
    result: dict[str, Any] = {}

    @property
    def is_ours(self) -> bool:
        """Return whether a bridge has sent the goal."""
        if self.status is None:
            return self.goal_id.uuid.startswith(_MARK)
        return self.status.goal_id.id.startswith(GOAL_PREFIX)


_MARK = base64.b64encode(GOAL_MARK).decode()  # its length is a multiple of three
_decode = msgspec.json.Decoder(_Report).decode


class Reports:
    """Reads feedback and result of actions for one client; `heard` gets action, part and its fields."""

    def __init__(self, client: Client, heard: Heard) -> None:
        self._client = client
        self._heard = heard
        self._reader: TapReader | None = None
        self._described: dict[str, asyncio.Event] = {}  # by topic: its publisher has answered
        self._actions: dict[str, str] = {}  # by topic

    async def listen(self, action: str, parts: Sequence[str]) -> None:
        """Read these topics of an action from now on; return when its server has answered, or after `READY_S`."""
        link = self._client.hub.link
        if self._reader is None or self._reader.feed.link is not link:
            self.leave()
            self._reader = TapReader(feed_of(link), self._deliver, self._state, lambda: False)
        topics = [f"{action}/{part}" for part in parts]
        for topic in topics:
            if topic not in self._described:
                self._described[topic], self._actions[topic] = asyncio.Event(), action
                self._reader.read(topic, "json", queue=QUEUE)
        described = (self._described[topic].wait() for topic in topics)
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.gather(*described), READY_S)

    def leave(self) -> None:
        """Read no more."""
        if self._reader is not None:
            self._reader.leave()
        self._described.clear()
        self._actions.clear()

    def _state(self, state: TapState) -> None:
        answered = state.type or state.refusal not in (None, STARTING)
        if answered and state.topic in self._described:
            self._described[state.topic].set()

    async def _deliver(self, topic: str, _form: Form, message: TapMessage) -> None:
        try:
            report = _decode(message.body)
        except msgspec.DecodeError:
            return
        action, part = self._actions.get(topic), topic.rpartition("/")[2]
        if report.is_ours and action is not None:
            await self._heard(action, part, report.feedback if part == FEEDBACK else report.result)
