"""Goals of gripper and torso, and the reports of their controllers."""

from __future__ import annotations

import time
from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.limbs import LimbReports, Limbs
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.shared.configuration.bridge_config import LimbSource, Topic


class LimbsTopics(RobotPart):
    """The limbs of one robot."""

    @classmethod
    def of(cls, node: Node) -> Limbs | None:
        return Limbs(node, _LimbTopics) if node.config.topics.limbs else None


class _LimbTopics(ActionTopics, GoalListener):
    """The topics of one limb's action."""

    def __init__(self, source: LimbSource, reports: LimbReports) -> None:
        self._source = source
        self._reports = reports
        super().__init__(Topic(source.action, source.type), self)

    def move(self, goal_id: str, to_m: float, seconds: float) -> None:
        message = self.goal_class()
        message.goal_id.id = goal_id
        message.header.stamp = message.goal_id.stamp = rospy.Time.from_sec(time.time())
        if self._source.is_command:
            command = message.goal.command
            command.position, command.max_effort = to_m, self._source.effort_n or 0.0
        else:
            message.goal.trajectory = self._trajectory(to_m, seconds)
        self.send(message)

    def _trajectory(self, to_m: float, seconds: float) -> JointTrajectory:
        joints = self._source.joints
        point = JointTrajectoryPoint(
            positions=[to_m / len(joints)] * len(joints), time_from_start=rospy.Duration.from_sec(seconds)
        )
        # The stamp is zero: the trajectory begins when it arrives. The base's own clock may be ahead.
        return JointTrajectory(joint_names=joints, points=[point])

    # --- on rospy's threads ---------------------------------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._reports.running({goal_id: status == GoalStatus.ACTIVE for goal_id, status in goals.items()})

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._reports.ended(goal_id, outcome, text, result)
