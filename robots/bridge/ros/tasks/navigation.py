"""The robot's own navigation: goals of its action, and poses that people set."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import rospy

from robots.bridge.navigation.navigation_goals import Navigator
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.navigation import SET_M2, SET_RAD2, NavigationReports
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.bridge.ros.tasks.publishing import Sender
from robots.shared.configuration.bridge_config import NavigationSource, Topic
from robots.shared.geometry.poses import Pose
from robots.shared.ros.message_types.classes import message_class


class NavigationTopics(Navigator, RobotPart, GoalListener):
    """The topics of one robot's navigation."""

    def __init__(self, node: Node, source: NavigationSource) -> None:
        self._node = node
        self._frame = source.frame
        self._reports = NavigationReports(node, source.frame)
        self._action = ActionTopics(Topic(source.action, source.type), self)
        posed = message_class("geometry_msgs/PoseWithCovarianceStamped")
        self._set_pose = Sender(source.set_pose, posed) if source.set_pose else None
        self._posed = posed
        self._listen(source.velocity, "geometry_msgs/Twist", self._reports.velocity)
        self._listen(source.pose, "geometry_msgs/PoseWithCovarianceStamped", self._reports.pose)
        if source.plan:
            self._listen(source.plan, "nav_msgs/Path", self._reports.plan)

    @classmethod
    def of(cls, node: Node) -> NavigationTopics | None:
        source = node.config.topics.navigation
        return cls(node, source) if source else None

    def located(self) -> tuple[float, Pose] | None:
        return self._node.located()

    def navigates(self) -> bool:
        return self._action.heard

    def go(self, goal_id: str, goal: Pose) -> None:
        self._reports.sends()
        message = self._action.goal_class()
        message.goal_id.id = goal_id
        message.header.stamp = message.goal_id.stamp = rospy.Time.from_sec(time.time())
        target = message.goal.target_pose
        target.header.frame_id = self._frame
        _fill(target.pose, goal)
        self._action.send(message)

    def cancel_navigation(self, goal_id: str) -> None:
        self._action.cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [self._action.cancel_all]

    def set_pose(self, pose: Pose) -> None:
        if self._set_pose is None:
            return
        message = self._posed()
        message.header.frame_id = self._frame
        message.header.stamp = rospy.Time.from_sec(time.time())
        _fill(message.pose.pose, pose)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = SET_M2
        covariance[35] = SET_RAD2
        message.pose.covariance = covariance
        self._set_pose.send(message)

    def _listen(self, topic: str, type_name: str, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, message_class(type_name), take, queue_size=1, tcp_nodelay=True)

    # --- on rospy's threads ---------------------------------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._reports.running(action, goals.keys())

    def feedback(self, goal_id: str, feedback: Any) -> None:
        self._reports.answered(goal_id)

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._reports.ended(goal_id, outcome, text)


def _fill(message: Any, pose: Pose) -> None:
    message.position.x, message.position.y = pose.x, pose.y
    message.orientation.z, message.orientation.w = math.sin(pose.yaw / 2.0), math.cos(pose.yaw / 2.0)
