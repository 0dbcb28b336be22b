"""Recorded motions over play_motion's action: goals with ids of our own, so that only these are cancelled."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401 isort: skip

from collections.abc import Callable
from typing import Any

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from robots.bridge.config import Topic
from robots.bridge.gate.sweep import Motion
from robots.bridge.motions import recorded
from robots.bridge.ros.publishing import publish
from robots.bridge.ros.types import message_class

RUNNING = (GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING)
OUTCOMES = {
    GoalStatus.SUCCEEDED: "succeeded",
    GoalStatus.PREEMPTED: "cancelled",
    GoalStatus.RECALLED: "cancelled",
    GoalStatus.REJECTED: "rejected",
}


class MotionTopics:
    """One motion action. `running` and `ended` are called on threads of rospy's."""

    def __init__(
        self, action: Topic, running: Callable[[list[str]], None], ended: Callable[[str, str, str], None]
    ) -> None:
        self._name = action.name
        self._kind = action.type.removesuffix("Action")
        self._running = running
        self._ended = ended
        self._goal_class = message_class(f"{self._kind}ActionGoal")
        self._goals = rospy.Publisher(f"{action.name}/goal", self._goal_class, queue_size=5)
        self._cancels = rospy.Publisher(f"{action.name}/cancel", GoalID, queue_size=5)
        self.publishers = [self._goals, self._cancels]
        self.repertoire: dict[str, Motion | None] = {}

    def read(self) -> None:
        """What the robot offers, from its parameters."""
        self.repertoire = recorded(rospy.get_param(f"{self._name}/motions", None))

    def subscribe(self) -> list[rospy.Subscriber]:
        """Listen."""
        result = message_class(f"{self._kind}ActionResult")
        return [
            rospy.Subscriber(f"{self._name}/status", GoalStatusArray, self._on_status, queue_size=1),
            rospy.Subscriber(f"{self._name}/result", result, self._on_result, queue_size=10),
        ]

    def play(self, goal_id: str, motion: str) -> None:
        """Send the goal. Planning is never skipped."""
        goal = self._goal_class()
        goal.goal_id.id = goal_id
        goal.goal.motion_name = motion
        publish(self._goals, goal)

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""
        publish(self._cancels, GoalID(id=goal_id))

    # --- on rospy's threads ------------------------------------------------------------------------

    def _on_status(self, message: Any) -> None:
        self._running([status.goal_id.id for status in message.status_list if status.status in RUNNING])

    def _on_result(self, message: Any) -> None:
        outcome = OUTCOMES.get(message.status.status, "failed")
        text = message.result.error_string or message.status.text
        self._ended(message.status.goal_id.id, outcome, text)
