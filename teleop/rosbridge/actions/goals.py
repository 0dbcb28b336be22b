"""The goals of one client: each is a task of the chain, with feedback, status and result under the client's own id."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from robots.link.client import BridgeLink, Listener
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal, State, TaskRequest
from teleop.background.jobs import run_in_background
from teleop.rosbridge.actions.ends import ABORTED, ACTIVE, PENDING, REJECTED, SUCCEEDED, End, Seen, end_of
from teleop.rosbridge.actions.reports import Reports
from teleop.rosbridge.actions.translation import FEEDBACK, RESULT, RobotAction
from teleop.rosbridge.family import Client

MOST_GOALS = 20  # of one client at once
RESULT_S = 1.0  # until the robot's result must have come after the end of its task

_TOO_MANY = Refusal("busy", "Too many goals at once: wait for the ends of others.", "wire")
_NO_STATE = Refusal("bridge_silent", "The robot’s bridge has not told its state yet. Try again.", "robot")


@dataclass(eq=False)
class Goal:
    """One goal. `told` sends the client its status after each change, and its end; `feedback` the robot's feedback."""

    id: str  # the client's own
    name: str  # of the action
    action: RobotAction
    told: Callable[[Goal, End | None], Coroutine[Any, Any, None]]
    feedback: Callable[[Goal, dict[str, Any]], Coroutine[Any, Any, None]]
    status: int = PENDING
    request: TaskRequest | None = None
    before: Seen | None = None
    cancelled: bool = False  # before it was accepted
    result: dict[str, Any] = field(default_factory=dict)  # the robot's own
    answered: asyncio.Event = field(default_factory=asyncio.Event)  # the robot's result has come


class Goals(Listener):
    """The goals of one client until their ends are told, in the order in which they came.

    They end with the link, and with the client.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._goals: list[Goal] = []
        self._link: BridgeLink | None = None
        self._reports = Reports(client, self._heard)

    def leave(self) -> None:
        """Forget all goals: the bridge ends their tasks with control."""
        self._goals.clear()
        self._reports.leave()
        if self._link:
            self._link.unsubscribe(self)

    def of(self, name: str) -> list[Goal]:
        """Return the goals of an action."""
        return [goal for goal in self._goals if goal.name == name]

    def __contains__(self, id_: str) -> bool:
        """Return whether the client waits for the end of a goal with this id."""
        return any(goal.id == id_ for goal in self._goals)

    def add(self, goal: Goal) -> None:
        """Count a goal as under way. `begin` follows."""
        self._goals.append(goal)

    async def begin(self, goal: Goal, given: dict[str, Any]) -> None:
        """Ask for the task of a goal with these fields. Raises NotDone, after its end was told."""
        if self._client.has_left:
            return
        try:
            if len(self._goals) > MOST_GOALS:
                raise NotDone(_TOO_MANY)
            make = goal.action.task(given)
            if goal.action.reports:
                await self._reports.listen(goal.name, goal.action.reports)
            await self._client.request(lambda fence, seq: self._requested(goal, make(fence, seq)))
        except NotDone as refused:
            self._forget(goal)
            await goal.told(goal, End(REJECTED, refused.refusal.coded_text))
            raise
        goal.status = ACTIVE
        await goal.told(goal, None)
        self._settle(self._seen())
        if goal.cancelled:
            await self.cancel(goal)

    async def cancel(self, goal: Goal) -> None:
        """Cancel the task of a goal. Raises NotDone."""
        goal.cancelled = True  # if it is not accepted yet, `begin` cancels it
        if goal.status == ACTIVE and goal in self._goals:
            await self._client.request(goal.action.cancel)

    def _requested(self, goal: Goal, request: TaskRequest) -> TaskRequest:
        """Note what was seen before the request goes: earlier ends are not the goal's."""
        goal.request, goal.before = request, self._seen()
        return request

    def _seen(self) -> Seen:
        """Return what the bridge told last. Raises NotDone."""
        link = self._client.hub.link
        if link is not self._link:
            if self._link:
                self._link.unsubscribe(self)
            self._link = link
            link.subscribe(self)
        if link.state is None:
            raise NotDone(link.refusal or _NO_STATE)
        return link.state

    def _settle(self, now: Seen) -> None:
        """End the goals whose tasks have ended."""
        for goal in [goal for goal in self._goals if goal.status == ACTIVE]:
            end = end_of(goal.request, goal.before, now) if goal.request and goal.before else None
            if end is not None:
                self._end(goal, end)
                for other in self._goals:  # this end is not theirs
                    if type(other.request) is type(goal.request):
                        other.before = now

    def _end(self, goal: Goal, end: End) -> None:
        goal.status = end.status
        run_in_background(self._tell_end(goal, end))

    async def _tell_end(self, goal: Goal, end: End) -> None:
        """Tell the end with the robot's result, which comes another way."""
        if end.status == SUCCEEDED and RESULT in goal.action.reports:
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(goal.answered.wait(), RESULT_S)
        elif end.status == SUCCEEDED:
            goal.result = goal.action.succeeded
        self._forget(goal)
        await goal.told(goal, end)

    async def _heard(self, action: str, part: str, fields: dict[str, Any]) -> None:
        """Take what the robot says about the goal of this console that it carries out."""
        waiting = [goal for goal in self.of(action) if not goal.answered.is_set()]
        active = [goal for goal in waiting if goal.status == ACTIVE]
        goal = next(iter(active or [goal for goal in waiting if goal.status == SUCCEEDED]), None)
        if goal is None:
            return
        if part == FEEDBACK:
            await goal.feedback(goal, fields)
        else:
            goal.result = fields
            goal.answered.set()

    def _forget(self, goal: Goal) -> None:
        if goal in self._goals:
            self._goals.remove(goal)

    # --- reports of the link (robots.link.client.Listener) ----------------------------------------------

    def on_status(self, state: State) -> None:
        self._settle(state)

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        """End all goals without a link: nobody here learns how their tasks end. The bridge ends them."""
        if up:
            return
        text = say("The link to the robot’s bridge was lost.")
        for goal in [goal for goal in self._goals if goal.status == ACTIVE]:
            self._end(goal, End(ABORTED, f"link_lost: {text}"))
