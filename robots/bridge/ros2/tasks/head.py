"""Sends the head's aim to its controller."""

from __future__ import annotations

from trajectory_msgs.msg import JointTrajectory

from robots.bridge.head.head import Aim
from robots.bridge.head.head_tasks import HeadMover
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.ros2.qos import EVENTS
from robots.bridge.ros2.tasks.actions import joined
from robots.bridge.ros2.tasks.trajectories import trajectory
from robots.shared.configuration.bridge_config import HeadSource


class HeadEnds(HeadMover, RobotPart):
    """The controller of one head, which takes joint positions."""

    def __init__(self, node: Node, source: HeadSource) -> None:
        self._node, self._source = node, source
        self._controller = joined(node).participant.node.create_publisher(
            JointTrajectory, source.topic, EVENTS
        )

    @classmethod
    def of(cls, node: Node) -> HeadEnds | None:
        head = node.config.topics.head
        return cls(node, head) if head else None

    def head_at(self) -> tuple[float, float] | None:
        pan, tilt = self._node.joint(self._source.pan_joint), self._node.joint(self._source.tilt_joint)
        return None if pan is None or tilt is None else (pan, tilt)

    def aim_head(self, aim: Aim) -> str | None:
        joints = {self._source.pan_joint: aim.pan, self._source.tilt_joint: aim.tilt}
        self._controller.publish(trajectory(joints, aim.seconds))
        return None
