"""The robot's own navigation: goals of its action, and poses that people set."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.serialization import deserialize_message

from robots.bridge.navigation.navigation_goals import Navigator
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.navigation import SET_M2, SET_RAD2, NavigationReports
from robots.bridge.ros2.drive import kind_heard
from robots.bridge.ros2.followed import FollowedTopic
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.participant import Subscription
from robots.bridge.ros2.qos import EVENTS, kept, sensor
from robots.bridge.ros2.tasks.actions import ActionEnds, GoalListener, joined
from robots.shared.configuration.bridge_config import NavigationSource, Topic, drive_topic
from robots.shared.geometry.poses import Pose

TWIST = "geometry_msgs/msg/Twist"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class NavigationEnds(Navigator, RobotPart, GoalListener):
    """One robot's navigation."""

    def __init__(self, node: Node, source: NavigationSource) -> None:
        self._node, self._frame = node, source.frame
        self._participant, self._followed = joined(node).participant, joined(node).followed
        self._graph = joined(node).graph
        self._reports = NavigationReports(node, source.frame)
        self._action = ActionEnds(self._participant, Topic(source.action, source.type), self)
        self._set_pose = None
        if source.set_pose:
            self._set_pose = self._participant.node.create_publisher(
                PoseWithCovarianceStamped, source.set_pose, EVENTS
            )
        self._velocity = drive_topic(source.velocity, TWIST, 2)
        self._kind = TWIST
        self._velocities: FollowedTopic | Subscription | None = self._listen_to_velocities(TWIST)
        self._listen(source.pose, POSE, self._reports.pose)
        if source.plan:
            self._listen(source.plan, "nav_msgs/msg/Path", self._reports.plan)

    @classmethod
    def of(cls, node: Node) -> NavigationEnds | None:
        source = node.config.topics.navigation
        return cls(node, source) if source else None

    def surveyed(self) -> None:
        """Read velocities as the robot's navigation publishes them: with a stamp or without."""
        kind = kind_heard(
            self._velocity,
            [one.topic_type for one in self._graph.publishers(self._velocity.name)],
            self._kind,
        )
        if self._velocities is None:
            self._velocities = self._listen_to_velocities(self._kind)
        elif kind != self._kind:
            # A process has one type of a topic: the executor may use the old subscription for a moment more.
            self._velocities.unregister()
            self._kind, self._velocities = kind, None

    def located(self) -> tuple[float, Pose] | None:
        return self._node.located()

    def navigates(self) -> bool:
        return self._action.heard

    def go(self, goal_id: str, goal: Pose) -> None:
        self._reports.sends()
        target = PoseStamped()
        self._head(target.header)
        _fill(target.pose, goal)
        self._action.send(goal_id, self._action.goal_class(pose=target))

    def cancel_navigation(self, goal_id: str) -> None:
        self._action.cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [self._action.cancel_all]

    def set_pose(self, pose: Pose) -> None:
        if self._set_pose is None:
            return
        message = PoseWithCovarianceStamped()
        self._head(message.header)
        _fill(message.pose.pose, pose)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = SET_M2
        covariance[35] = SET_RAD2
        message.pose.covariance = covariance
        self._set_pose.publish(message)

    def _head(self, header: Any) -> None:
        header.frame_id = self._frame
        header.stamp.sec, header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)

    def _listen_to_velocities(self, kind: str) -> FollowedTopic | Subscription:
        take = self._reports.velocity
        return self._listen(
            self._velocity.name, kind, take if kind == TWIST else lambda message: take(message.twist)
        )

    def _listen(
        self, topic: str, type_name: str, take: Callable[[Any], None]
    ) -> FollowedTopic | Subscription:
        """Give `take` the messages; of the pose also the last one, which localisation keeps while the robot stands."""
        kind = message_class(type_name)

        def read(raw: bytes, _info: Any) -> None:
            take(deserialize_message(raw, kind))

        if type_name == POSE:
            return self._followed.listen(topic, type_name, read, kept)
        return self._participant.listen(topic, type_name, read, sensor(1))

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._reports.running(action, goals.keys())

    def feedback(self, goal_id: str, feedback: Any) -> None:
        self._reports.answered(goal_id)

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        if outcome == "failed" and self._action.others_run:
            outcome = (
                "cancelled"  # navigation gives up a goal when another takes its place; in ROS 1 it cancels it
            )
        self._reports.ended(goal_id, outcome, text)


def _fill(message: Any, pose: Pose) -> None:
    message.position.x, message.position.y = float(pose.x), float(pose.y)
    message.orientation.z, message.orientation.w = math.sin(pose.yaw / 2.0), math.cos(pose.yaw / 2.0)
