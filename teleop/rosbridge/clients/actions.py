"""Actions of clients: one client advertises an action, others send it goals."""

from __future__ import annotations

from itertools import count
from typing import Any, NamedTuple

from robots.shared.wire import NotDone, Refusal
from teleop.background.jobs import run_in_background
from teleop.rosbridge.actions.ends import ABORTED, IN_ROS2
from teleop.rosbridge.clients.advertised import Advertised, Advertisements
from teleop.rosbridge.clients.services import CLIENT_LEFT
from teleop.rosbridge.family import Client
from teleop.rosbridge.operations import ActionFeedback, ActionResult, Id, SendActionGoal

MOST_GOALS = 20  # of one client's actions at once

_BUSY = Refusal("busy", "Too many goals at once: wait for the ends of others.", "wire")
_NO_GOAL = Refusal("no_goal", "No goal with this id is under way.", "wire")


class _Taken(NamedTuple):
    """A goal of another client that this one carries out."""

    advertised: Advertised
    asker: ClientActions
    id: Id  # the asker's own
    feedback: bool


class ClientActions:
    """The actions that a client offers, the goals that it carries out, and those that it sent to others."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.advertised = Advertisements(client, "action")
        self._numbers = count(1)
        self._taken: dict[str, _Taken] = {}  # by the id that this client got
        self._sent: dict[
            Id, tuple[ClientActions, str]
        ] = {}  # by this client's id: who carries it out, and its id there

    def leave(self) -> None:
        """Cancel the goals that this client sent; end those that it carries out."""
        self.advertised.remove_all()
        for server, number in list(self._sent.values()):
            run_in_background(server.cancelled(number))
        for number in list(self._taken):
            run_in_background(self._end(number, {"result": False, "values": _worded(CLIENT_LEFT)}))

    def __contains__(self, id_: str) -> bool:
        """Return whether this client waits for the end of a goal with this id that it sent to another."""
        return id_ in self._sent

    # --- as the one that asks ---------------------------------------------------------------------------

    async def send(self, advertised: Advertised, goal: SendActionGoal) -> None:
        """Send a goal to the client that offers this action. Raises NotDone."""
        server: ClientActions = self.advertised.usable(advertised).server
        await server.take(_Taken(advertised, self, goal.id, goal.feedback), goal.args or {})

    async def cancel(self, id_: Id) -> bool:
        """Ask for the cancel of a goal that this client sent. Return whether there is one."""
        if id_ not in self._sent:
            return False
        server, number = self._sent[id_]
        await server.cancelled(number)
        return True

    # --- as the one that carries out ----------------------------------------------------------------------

    async def take(self, goal: _Taken, args: Any) -> None:
        """Pass a goal to this client. Raises NotDone."""
        if len(self._taken) >= MOST_GOALS:
            raise NotDone(_BUSY)
        number = f"goal:{next(self._numbers)}"
        self._taken[number] = goal
        goal.asker._sent[goal.id] = self, number
        await self.client.send(
            {
                "op": "send_action_goal",
                "id": number,
                "action": goal.advertised.own,
                "action_type": goal.advertised.type,
                "args": args,
                "feedback": goal.feedback,
            }
        )

    async def cancelled(self, number: str) -> None:
        """Pass a cancel to this client, which decides how the goal ends."""
        if number in self._taken:
            action = self._taken[number].advertised.own
            await self.client.send({"op": "cancel_action_goal", "id": number, "action": action})

    async def feedback(self, operation: ActionFeedback) -> None:
        """Pass this client's feedback to the one that asked. Raises NotDone."""
        goal = self._goal(operation.id)
        if goal.feedback:
            message = {
                "op": "action_feedback",
                "id": goal.id,
                "action": goal.advertised.name,
                "values": operation.values,
            }
            await goal.asker.client.pass_on(message)

    async def result(self, operation: ActionResult) -> None:
        """Pass this client's result to the one that asked. Raises NotDone."""
        self._goal(operation.id)
        told = {"result": operation.result, "values": operation.values}
        await self._end(
            str(operation.id), told if operation.status is None else {**told, "status": operation.status}
        )

    def _goal(self, id_: Id) -> _Taken:
        if (goal := self._taken.get(str(id_))) is None:
            raise NotDone(_NO_GOAL)
        return goal

    async def _end(self, number: str, told: dict[str, Any]) -> None:
        goal = self._taken.pop(number)
        goal.asker._sent.pop(goal.id, None)
        answer = {
            "op": "action_result",
            "id": goal.id,
            "action": goal.advertised.name,
            "status": IN_ROS2[ABORTED],
        }
        await goal.asker.client.send(answer | told)


def _worded(refusal: Refusal) -> str:
    return f"{refusal.code}: {refusal.text}"
