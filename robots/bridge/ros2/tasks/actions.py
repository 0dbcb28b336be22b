"""One action of the robot, by its three services and two topics. Goals have our own ids, so that we can cancel these.

rclpy's own client loses an answer that comes while a goal is still being sent on another thread.
"""

from __future__ import annotations

import os
import time
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Protocol, cast

import numpy as np
from rclpy.serialization import deserialize_message

from robots.bridge.robot.interface import Node
from robots.bridge.ros2.followed import FollowedTopics
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.participant import Participant, guarded
from robots.bridge.ros2.qos import EVENTS, STATIC
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.bridge.ros2.tasks.cancels import cancel_client, cancel_goals
from robots.bridge.tasks.goals import OURS
from robots.shared.configuration.bridge_config import Topic
from robots.shared.texts import MOST_GOALS, MOST_NODES, most_of
from robots.shared.wire import GOAL_MARK

# action_msgs/msg/GoalStatus
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = 1, 2, 3, 4, 5, 6
OUTCOMES = {SUCCEEDED: "succeeded", CANCELED: "cancelled"}  # others: "failed"
ID_BYTES = 16
RESULT_S = 3.0  # a goal that its server says is over ends then, if its result is late or lost
REPEAT_S = 0.5  # servers tell a status once, when it changes; who waits for a goal counts on word of it


class Joined(Node, Protocol):
    """The node, as parts of this side use it."""

    participant: Participant
    graph: Graph
    followed: FollowedTopics


def joined(node: Node) -> Joined:
    """Return the node with what only this side has."""
    return cast("Joined", node)


class GoalListener(ABC):
    """Receiver of an action's reports, on the executor's thread."""

    @abstractmethod
    def running(self, action: str, goals: dict[str, int]) -> None:
        """Take the running goals of all senders, and their status."""

    def feedback(self, goal_id: str, feedback: Any) -> None:  # noqa: B027  (not every action's is of use)
        """Take feedback of one of our goals."""

    @abstractmethod
    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Take the end of one of our goals: one of `OUTCOMES`, "rejected" or "failed"."""


class ActionEnds:
    """Our end of one action. `on_joined` is called whenever a server appears."""

    def __init__(
        self,
        participant: Participant,
        action: Topic,
        listener: GoalListener,
        on_joined: Callable[[], None] = lambda: None,
    ) -> None:
        kind = message_class(action.type)
        self.name, self.goal_class = action.name, kind.Goal
        self._listener, self._on_joined = listener, on_joined
        self._node = node = participant.node
        self._feedback_class = kind.Impl.FeedbackMessage
        self._goals = node.create_client(kind.Impl.SendGoalService, f"{action.name}/_action/send_goal")
        self._results = node.create_client(kind.Impl.GetResultService, f"{action.name}/_action/get_result")
        self._cancels = cancel_client(node, action.name)
        self._sent: OrderedDict[bytes, str] = OrderedDict()  # our ids of goals, by those on the wire
        self._open: set[str] = set()  # our goals without a result so far
        # Those that a server says are over and none says run, with status and time of its word.
        self._over: dict[str, tuple[int, float]] = {}
        # Those whose server gave them up, with result and its time, until its status comes: it has the goal that took
        # their place.
        self._given_up: dict[str, tuple[Any, float]] = {}
        self._status = f"{action.name}/_action/status"
        # Goals that run, by who said so last: what a server that has gone said holds no more.
        self._said: OrderedDict[bytes, dict[str, int]] = OrderedDict()
        self._was_there = False
        listen = participant.listen
        self._subscriptions = [
            listen(self._status, "action_msgs/msg/GoalStatusArray", self._on_status, STATIC),
            listen(f"{action.name}/_action/feedback", self._feedback_class, self._on_feedback, EVENTS),
        ]
        self._timer = node.create_timer(REPEAT_S, guarded(self._repeat))

    def send(self, goal_id: str, goal: Any) -> None:
        """Send a goal with this id of ours."""
        wired = GOAL_MARK + os.urandom(ID_BYTES - len(GOAL_MARK))
        self._sent[wired] = goal_id
        self._open.add(goal_id)
        while len(self._sent) > MOST_GOALS:
            self._open.discard(self._sent.popitem(last=False)[1])
        request = self._goals.srv_type.Request(goal=goal)
        request.goal_id.uuid = np.frombuffer(wired, np.uint8)
        self._goals.call_async(request).add_done_callback(guarded(partial(self._answered, goal_id, wired)))

    @property
    def heard(self) -> bool:
        """Return whether a node of the robot takes goals."""
        return bool(self._goals.service_is_ready())

    @property
    def others_run(self) -> bool:
        """Return whether a server says that it performs a goal of another program. On the executor's thread."""
        return any(not goal_id.startswith(OURS) for goals in self._said.values() for goal_id in goals)

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""
        wired = next((key for key, value in list(self._sent.items()) if value == goal_id), None)
        if wired is None and goal_id.startswith(OURS):  # of the bridge before this one: `_named`
            wired = bytes.fromhex(goal_id.rpartition("-")[2])
        if wired is not None:
            cancel_goals([self._cancels], wired)

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""
        cancel_goals([self._cancels])

    def close(self) -> None:
        """Leave the action."""
        for subscription in self._subscriptions:
            subscription.unregister()
        self._node.destroy_timer(self._timer)
        for client in (self._goals, self._results, self._cancels):
            self._node.destroy_client(client)

    # --- on the executor's thread ----------------------------------------------------------------------

    def _answered(self, goal_id: str, wired: bytes, answer: Any) -> None:
        """Wait for the result of an accepted goal."""
        if not answer.result().accepted:
            self._end(goal_id, "rejected", None)
            return
        request = self._results.srv_type.Request()
        request.goal_id.uuid = np.frombuffer(wired, np.uint8)
        self._results.call_async(request).add_done_callback(guarded(partial(self._ended, goal_id)))

    def _ended(self, goal_id: str, answer: Any) -> None:
        found = answer.result()
        if found.status == ABORTED and goal_id in self._open and goal_id not in self._over:
            self._given_up[goal_id] = found.result, time.monotonic()
            return
        self._end(goal_id, OUTCOMES.get(found.status, "failed"), found.result)

    def _end(self, goal_id: str, outcome: str, result: Any) -> None:
        self._over.pop(goal_id, None)
        self._given_up.pop(goal_id, None)
        for goals in self._said.values():
            goals.pop(goal_id, None)
        if goal_id in self._open:
            self._open.remove(goal_id)
            self._listener.ended(goal_id, outcome, "", result)

    def _on_status(self, raw: bytes, info: Any) -> None:
        gid = info.get("publisher_gid")  # None before Iron
        goals = {}
        for wired, status in statuses(raw):
            if status <= CANCELING:
                goals[self._named(wired)] = status
            elif (ours := self._sent.get(wired, "")) in self._open:
                self._over.setdefault(ours, (status, time.monotonic()))
        self._said[bytes(gid["data"]) if gid else b""] = most_of(goals, OURS)
        while len(self._said) > MOST_NODES:
            self._said.popitem(last=False)
        for goal_id in self._over.keys() & self._given_up.keys():
            self._end(goal_id, "failed", self._given_up[goal_id][0])
        for running in self._said.values():  # who says that such a goal is over may be a stranger
            for goal_id in self._over.keys() & running:
                del self._over[goal_id]
        self._tell()

    def _tell(self) -> None:
        running = {goal: status for goals in self._said.values() for goal, status in goals.items()}
        running |= dict.fromkeys(self._over, EXECUTING)  # until the result comes
        self._listener.running(self.name, most_of(running, OURS))

    def _on_feedback(self, raw: bytes, _info: Any) -> None:
        message = deserialize_message(raw, self._feedback_class)
        goal_id = self._sent.get(bytes(message.goal_id.uuid))
        if goal_id is not None:
            self._listener.feedback(goal_id, message.feedback)

    def _repeat(self) -> None:
        is_there = self.heard
        if is_there and not self._was_there:
            self._on_joined()
        self._was_there = is_there
        self._forget_gone(is_there)
        for goal_id, (result, since_s) in list(self._given_up.items()):
            if time.monotonic() - since_s > REPEAT_S:
                self._end(goal_id, "failed", result)
        for goal_id, (status, since_s) in list(self._over.items()):
            if time.monotonic() - since_s > RESULT_S:
                self.cancel(goal_id)  # nobody would follow it any more, if its server has not ended it
                self._end(goal_id, OUTCOMES.get(status, "failed"), None)
        self._tell()

    def _forget_gone(self, is_there: bool) -> None:
        """Forget what servers said that have left: another one may have come in their place, and knows no goal."""
        if not is_there:
            self._said.clear()
        # Of too many publishers a look would take long.
        if any(self._said.values()) and self._node.count_publishers(self._status) <= MOST_NODES:
            found = self._node.get_publishers_info_by_topic(self._status)
            there = {b"", *(bytes(one.endpoint_gid) for one in found)}
            for gone in self._said.keys() - there:
                del self._said[gone]

    def _named(self, wired: bytes) -> str:
        """Return the name of a goal: those of earlier bridges count as ours."""
        ours = f"{OURS}earlier-" if wired.startswith(GOAL_MARK) else ""
        return self._sent.get(wired) or f"{ours}{wired.hex()}"


def statuses(raw: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield id and status of the goals of an action_msgs/msg/GoalStatusArray."""
    message = Cdr(raw)
    for _ in range(message.number()):
        wired = bytes(message.data(ID_BYTES))
        message.values("iI", 4)
        yield wired, message.number("b", 1)
