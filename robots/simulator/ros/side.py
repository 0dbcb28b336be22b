"""ROS 1 for the simulated robot's topics and actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.ros.actions.goals import ActionGoals
from robots.simulator.ros_side import NANO, Goals, Stamp


class TopicPublisher:
    """A topic that this node advertises."""

    def __init__(self, topic: str, kind: str, queue: int, kept: bool) -> None:
        self._publisher = rospy.Publisher(
            topic, message_class(kind), queue_size=queue, latch=kept, tcp_nodelay=True
        )

    @property
    def wanted(self) -> bool:
        return bool(self._publisher.get_num_connections())

    def publish(self, message: Any) -> None:
        self._publisher.publish(message)


class RospySide:
    """`robots.simulator.ros_side.RosSide`, for the node of this process."""

    def publisher(
        self, topic: str, kind: str, *, queue: int = 1, kept: bool = False, sensor: bool = False
    ) -> TopicPublisher:
        return TopicPublisher(topic, kind, queue, kept)

    def subscribe(
        self, topic: str, kind: str, take: Callable[[Any], None], *, queue: int | None = None
    ) -> None:
        rospy.Subscriber(topic, message_class(kind), take, queue_size=queue, tcp_nodelay=True)

    def goals(self, action: str, kind: str) -> Goals:
        return ActionGoals(action, kind)

    def now(self) -> Stamp:
        return int(rospy.Time.now().to_nsec())

    def new(self, kind: str, **fields: Any) -> Any:
        return message_class(kind)(**fields)

    def stamped(self, message: Any, stamp: Stamp, frame: str = "") -> Any:
        message.header.stamp = rospy.Time(stamp // NANO, stamp % NANO)
        message.header.frame_id = frame
        return message

    def calibrated(self, info: Any, **matrices: list[float]) -> Any:
        for letter, matrix in matrices.items():
            setattr(info, letter.upper(), matrix)
        return info

    def seconds(self, duration: Any) -> float:
        return float(duration.to_sec())

    def octets(self, data: bytes) -> bytes:
        return data

    def octet(self, value: int) -> int:
        return value
