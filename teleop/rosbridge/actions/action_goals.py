"""Actions: goals of the robot's actions become tasks, those of clients' actions go to these clients."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared.configuration.bridge_config import CLIENTS, Topics
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.background.jobs import run_in_background
from teleop.rosbridge.actions.ends import IN_ROS2, PREEMPTED, REJECTED, SUCCEEDED, End
from teleop.rosbridge.actions.goals import Goal, Goals
from teleop.rosbridge.actions.translation import RobotAction, actions_of
from teleop.rosbridge.clients.actions import ClientActions
from teleop.rosbridge.family import Client, Family, Handler, Service
from teleop.rosbridge.operations import (
    ActionFeedback,
    ActionResult,
    AdvertiseAction,
    CancelActionGoal,
    Operation,
    Publish,
    SendActionGoal,
    UnadvertiseAction,
    full_name,
    full_type,
)

CANCEL_ALL = "/_action/cancel_goal"  # a service by which ROS 2 clients cancel all goals of an action
LONGEST_ID = 200  # characters

_NO_GOAL = Refusal("no_goal", "No goal of yours with this id is under way.", "wire")
_TWICE = Refusal("goal_twice", "A goal with this id is under way.", "wire")
_NO_ID = Refusal("invalid", "A goal needs an id of at most 200 characters.", "wire")


class ActionGoals(Family):
    """The goals of one client in both styles: by operations (ROS 2), and by an action's topics (ROS 1)."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._goals = Goals(client)
        self._clients = ClientActions(client)
        self._read: tuple[Topics | None, dict[str, RobotAction]] = (None, {})

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {
            SendActionGoal: self._send,
            CancelActionGoal: self._cancel,
            AdvertiseAction: self._advertise,
            UnadvertiseAction: self._unadvertise,
            ActionFeedback: self._feedback,
            ActionResult: self._result,
        }

    def publisher(self, topic: str) -> Handler | None:
        name, _, part = topic.rpartition("/")
        if name not in self._actions:
            return None
        return {"goal": self._goal_published, "cancel": self._cancel_published}.get(part)

    def service(self, name: str) -> Service | None:
        action = name.removesuffix(CANCEL_ALL)
        offered = action in self._actions or action.startswith(CLIENTS)
        return self._cancel_all(action) if action != name and offered else None

    def actions(self) -> Iterable[str]:
        return self._clients.advertised.listed()

    def leave(self) -> None:
        self._goals.leave()
        self._clients.leave()

    @property
    def _actions(self) -> dict[str, RobotAction]:
        topics = self.client.hub.entry.topics
        if self._read[0] is not topics:
            self._read = topics, actions_of(topics) if topics else {}
        return self._read[1]

    # --- by operations ------------------------------------------------------------------------------------

    async def _send(self, operation: SendActionGoal) -> None:
        name = full_name(operation.action)
        if isinstance(operation.id, str):
            self._require_new(operation.id)  # no end is told: the client would take it for that of the other
        try:
            given = operation.args or {}
            if not isinstance(operation.id, str) or not isinstance(given, dict):
                raise NotDone(_NO_ID)
            if (server := self._clients.advertised.usable(name)) is not None:
                self.client.require(Scope.TOPICS)
                await self._clients.send(server, name, operation, given)
                return
            action = self._robots(name)
        except NotDone as refused:
            await self._result_told(operation, End(REJECTED, refused.refusal.coded_text))
            raise

        async def told(goal: Goal, end: End | None) -> None:
            if end is not None:
                await self._result_told(operation, end, goal.result)

        async def feedback(_goal: Goal, fields: dict[str, Any]) -> None:
            if operation.feedback:
                await self.client.send(_told("action_feedback", operation, values=fields))

        self._begin_soon(Goal(operation.id, name, action, told, feedback), given, operation)

    async def _result_told(
        self, operation: SendActionGoal, end: End, result: dict[str, Any] | None = None
    ) -> None:
        done = end.status in (SUCCEEDED, PREEMPTED)
        values = (result or {}) if done else end.text
        status = IN_ROS2[end.status]
        await self.client.send(_told("action_result", operation, values=values, status=status, result=done))

    async def _cancel(self, operation: CancelActionGoal) -> None:
        if await self._clients.cancel(operation.id):
            return
        goals = [goal for goal in self._goals.of(full_name(operation.action)) if goal.id == operation.id]
        if not goals:
            raise NotDone(_NO_GOAL)
        self._cancel_soon(goals, operation)

    def _cancel_all(self, name: str) -> Service:
        async def cancel(_arguments: dict[str, Any]) -> dict[str, Any]:
            for goal in self._goals.of(name):
                await self._goals.cancel(goal)
            for id_ in self._clients.of(name):
                await self._clients.cancel(id_)
            return {"return_code": 0, "goals_canceling": []}

        return cancel

    # --- by the topics of an action -------------------------------------------------------------------------

    async def _goal_published(self, operation: Publish) -> None:
        name = full_name(operation.topic).removesuffix("/goal")
        goal_id, given = _part(operation.msg, "goal_id"), _part(operation.msg, "goal")
        id_ = goal_id.get("id")
        if not isinstance(id_, str) or not 0 < len(id_) <= LONGEST_ID:
            raise NotDone(_NO_ID)
        self._require_new(id_)
        goal = Goal(id_, name, self._robots(name), self._published, self._feedback_published)
        self._begin_soon(goal, given, operation)

    async def _cancel_published(self, operation: Publish) -> None:
        """Cancel the goal of this id; an empty id means all goals: here all goals of this client, of no other."""
        goals = self._goals.of(full_name(operation.topic).removesuffix("/cancel"))
        id_ = operation.msg.get("id")
        named = [goal for goal in goals if not id_ or goal.id == id_]
        if id_ and not named:
            raise NotDone(_NO_GOAL)
        self._cancel_soon(named, operation)

    async def subscribed(self, topic: str) -> None:
        """Say that an action is there: clients of ROS 1 wait for a first status, which no topic of ROS 2 has.

        It has this client's goals: one that is missing counts as lost.
        """
        name = topic.removesuffix("/status")
        if name != topic and name in self._actions:
            present = [_status(goal, None) for goal in self._goals.of(name)]
            await self._show(topic, {"header": _header(), "status_list": present})

    async def _published(self, goal: Goal, end: End | None) -> None:
        """Send the client messages as an action's server publishes them, with its own id."""
        status = _status(goal, end)
        await self._show(f"{goal.name}/status", {"header": _header(), "status_list": [status]})
        if end is not None:
            await self._show(
                f"{goal.name}/result", {"header": _header(), "status": status, "result": goal.result}
            )

    async def _feedback_published(self, goal: Goal, fields: dict[str, Any]) -> None:
        message = {"header": _header(), "status": _status(goal, None), "feedback": fields}
        await self._show(f"{goal.name}/feedback", message)

    async def _show(self, topic: str, message: dict[str, Any]) -> None:
        for family in self.client.families:
            await family.show(topic, message)

    # --- in the background --------------------------------------------------------------------------------

    def _require_new(self, id_: str) -> None:
        """Raise NotDone while a goal of this client has this id."""
        if id_ in self._goals or id_ in self._clients:
            raise NotDone(_TWICE)

    def _begin_soon(self, goal: Goal, given: dict[str, Any], operation: SendActionGoal | Publish) -> None:
        self._goals.add(goal)
        run_in_background(self._begin(goal, given, operation))

    async def _begin(self, goal: Goal, given: dict[str, Any], operation: SendActionGoal | Publish) -> None:
        of = "publish" if isinstance(operation, Publish) else "send_action_goal"
        try:
            await self._goals.begin(goal, given)
        except NotDone as refused:
            await self.client.refuse(of, refused.refusal, operation.id)

    def _cancel_soon(self, goals: list[Goal], operation: CancelActionGoal | Publish) -> None:
        for goal in goals:
            run_in_background(self._cancel_one(goal, operation))

    async def _cancel_one(self, goal: Goal, operation: CancelActionGoal | Publish) -> None:
        of = "publish" if isinstance(operation, Publish) else "cancel_action_goal"
        try:
            await self._goals.cancel(goal)
        except NotDone as refused:
            await self.client.refuse(of, refused.refusal, operation.id)

    def _robots(self, name: str) -> RobotAction:
        if name not in self._actions:
            known = ", ".join(sorted(self._actions)) or say("none")
            text = say(
                "No task does the goals of {name}. Actions with tasks: {known}.", name=name, known=known
            )
            raise NotDone(Refusal("not_allowed", text, "robot", {"name": name}))
        return self._actions[name]

    # --- actions of clients -----------------------------------------------------------------------------

    async def _advertise(self, operation: AdvertiseAction) -> None:
        self.client.require(Scope.TOPICS)
        self._clients.advertised.add(full_name(operation.action), full_type(operation.type))

    async def _unadvertise(self, operation: UnadvertiseAction) -> None:
        if not await self._clients.unadvertise(full_name(operation.action)):
            text = say("This client does not advertise {topic}.", topic=operation.action)
            await self.client.status("warning", f"not_advertised: {text}", operation.id)

    async def _feedback(self, operation: ActionFeedback) -> None:
        await self._clients.feedback(operation)

    async def _result(self, operation: ActionResult) -> None:
        await self._clients.result(operation)


_ZERO = {"secs": 0, "nsecs": 0}


def _told(op: str, operation: SendActionGoal, **fields: Any) -> dict[str, Any]:
    return {"op": op, "id": operation.id, "action": operation.action, **fields}


def _status(goal: Goal, end: End | None) -> dict[str, Any]:
    status = end.status if end else goal.status
    return {"goal_id": {"stamp": _ZERO, "id": goal.id}, "status": status, "text": end.text if end else ""}


def _header() -> dict[str, Any]:
    secs, nsecs = divmod(time.time_ns(), 1_000_000_000)
    return {"seq": 0, "stamp": {"secs": secs, "nsecs": nsecs}, "frame_id": ""}


def _part(message: dict[str, Any], name: str) -> dict[str, Any]:
    part = message.get(name)
    return part if isinstance(part, dict) else {}
