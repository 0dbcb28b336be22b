"""Actions of clients: one client advertises an action, others send it goals."""

from __future__ import annotations

from itertools import count
from typing import Any, NamedTuple

from robots.shared.wire import NotDone, Refusal
from teleop.background.jobs import run_in_background
from teleop.rosbridge.actions.ends import ABORTED, IN_ROS2
from teleop.rosbridge.clients.advertised import Advertisements
from teleop.rosbridge.clients.letters import (
    CLIENT_LEFT,
    Address,
    Cancel,
    Feedback,
    Goal,
    Gone,
    Result,
)
from teleop.rosbridge.clients.post import post_of
from teleop.rosbridge.family import Client
from teleop.rosbridge.operations import ActionFeedback, ActionResult, Id, SendActionGoal

MOST_GOALS = 20  # of one client's actions at once; the same of those that one client sent to others

_BUSY = Refusal("busy", "Too many goals at once: wait for the ends of others.", "wire")
_NO_GOAL = Refusal("no_goal", "No goal with this id is under way.", "wire")


class _Sent(NamedTuple):
    """A goal that this client sent to another."""

    to: Address
    action: str


class _Taken(NamedTuple):
    """A goal of another client that this one carries out."""

    by: Address
    id: str  # the asker's own
    name: str
    own: str  # the action, as this client wrote it
    feedback: bool


class ClientActions:
    """The actions that a client offers, the goals that it carries out, and those that it sent to others."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.advertised = Advertisements(client, "action")
        self._numbers = count(1)
        self._taken: dict[str, _Taken] = {}  # by the id that this client got
        self._sent: dict[str, _Sent] = {}  # by this client's id
        self._post = post_of(client.hub)
        self._address = self._post.join(
            client.id,
            {
                Goal: self._goal_came,
                Cancel: self._cancel_came,
                Feedback: self._feedback_came,
                Result: self._result_came,
                Gone: self._went,
            },
        )

    def leave(self) -> None:
        """Cancel the goals that this client sent; end those that it carries out."""
        for id_, sent in self._sent.items():
            run_in_background(self._post.send(self._address, sent.to, Cancel(id_)))
        for number in list(self._taken):
            run_in_background(self._give_up(number))
        self._post.leave(self.client.id)

    def __contains__(self, id_: str) -> bool:
        """Return whether this client waits for the end of a goal with this id that it sent to another."""
        return id_ in self._sent

    # --- as the one that asks ---------------------------------------------------------------------------

    async def send(self, server: Address, name: str, goal: SendActionGoal, args: dict[str, Any]) -> None:
        """Send a goal to the client that offers this action. Raises NotDone."""
        id_ = str(goal.id)
        if len(self._sent) >= MOST_GOALS:
            raise NotDone(_BUSY)
        self._sent[id_] = _Sent(server, name)
        try:
            await self._post.send(self._address, server, Goal(id_, name, args, goal.feedback))
        except NotDone:
            del self._sent[id_]
            raise

    def of(self, name: str) -> list[str]:
        """Return the ids of the goals that this client sent to an action."""
        return [id_ for id_, sent in self._sent.items() if sent.action == name]

    async def cancel(self, id_: Id) -> bool:
        """Ask for the cancel of a goal that this client sent. Return whether there is one. Raises NotDone."""
        if (sent := self._sent.get(str(id_))) is None:
            return False
        await self._post.send(self._address, sent.to, Cancel(str(id_)))
        return True

    async def _feedback_came(self, _by: Address, feedback: Feedback) -> None:
        if (sent := self._sent.get(feedback.id)) is not None:
            await self.client.pass_on(
                _told("action_feedback", feedback.id, sent.action, values=feedback.values)
            )

    async def _result_came(self, _by: Address, result: Result) -> None:
        if (sent := self._sent.pop(result.id, None)) is None:
            return
        refusal, fields = result.refusal, result.fields
        if refusal is not None:
            fields = {"result": False, "values": refusal.coded_text}
        fields = {"status": IN_ROS2[ABORTED], **fields}
        await self.client.send(_told("action_result", result.id, sent.action, **fields))
        if refusal is not None:
            await self.client.refuse("send_action_goal", refusal, result.id)

    # --- as the one that carries out ----------------------------------------------------------------------

    async def unadvertise(self, own: str) -> bool:
        """End an offer and its goals. Return whether there was one."""
        name = self.advertised.remove(own)
        for number in [number for number, taken in self._taken.items() if taken.name == name]:
            await self._give_up(number)
        return name is not None

    async def _give_up(self, number: str) -> None:
        if (taken := self._taken.pop(number, None)) is not None:
            await self._post.send(self._address, taken.by, Result(taken.id, refusal=CLIENT_LEFT))

    async def _goal_came(self, by: Address, goal: Goal) -> None:
        own = self.advertised.mine.get(goal.name)
        if own is None or len(self._taken) >= MOST_GOALS:
            refusal = CLIENT_LEFT if own is None else _BUSY
            await self._post.send(self._address, by, Result(goal.id, refusal=refusal))
            return
        number = f"goal:{next(self._numbers)}"
        self._taken[number] = _Taken(by, goal.id, goal.name, own, goal.feedback)
        action_type = self.advertised.listed().get(goal.name, "")
        fields = {"action_type": action_type, "args": goal.args, "feedback": goal.feedback}
        await self.client.send(_told("send_action_goal", number, own, **fields))

    async def _cancel_came(self, by: Address, cancel: Cancel) -> None:
        """Pass a cancel to this client, which decides how the goal ends."""
        for number, taken in list(self._taken.items()):
            if (taken.by, taken.id) == (by, cancel.id):
                await self.client.send(_told("cancel_action_goal", number, taken.own))

    async def feedback(self, operation: ActionFeedback) -> None:
        """Pass this client's feedback to the one that asked. Raises NotDone."""
        taken = self._goal(operation.id)
        if taken.feedback:
            await self._post.send(self._address, taken.by, Feedback(taken.id, operation.values))

    async def result(self, operation: ActionResult) -> None:
        """Pass this client's result to the one that asked. Raises NotDone."""
        taken = self._goal(operation.id)
        fields = {"result": operation.result, "values": operation.values}
        if operation.status is not None:
            fields["status"] = operation.status
        del self._taken[str(operation.id)]
        await self._post.send(self._address, taken.by, Result(taken.id, fields))

    def _goal(self, id_: Id) -> _Taken:
        if (taken := self._taken.get(str(id_))) is None:
            raise NotDone(_NO_GOAL)
        return taken

    # --- another web process is gone ------------------------------------------------------------------------

    async def _went(self, _by: Address, gone: Gone) -> None:
        """End the goals of which the other end is gone."""
        for id_, sent in list(self._sent.items()):
            if sent.to.process == gone.process:
                await self._result_came(sent.to, Result(id_, refusal=CLIENT_LEFT))
        for number, taken in list(self._taken.items()):
            if taken.by.process == gone.process:
                await self.client.send(_told("cancel_action_goal", number, taken.own))


def _told(op: str, id_: str, action: str, **fields: Any) -> dict[str, Any]:
    return {"op": op, "id": id_, "action": action, **fields}
