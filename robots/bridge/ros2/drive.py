"""What bridge and watchdog send to a robot: velocities, and cancels of all goals of an action."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from robots.bridge.ros2.qos import ONE_ANSWER
from robots.shared.configuration.bridge_config import Topic
from robots.shared.geometry.poses import Velocity

log = logging.getLogger(__name__)


def twist_class(drive: Topic) -> type[Any]:
    """Return the class of messages on the drive topic."""
    kind: type[Any] = TwistStamped if drive.type.endswith("/TwistStamped") else Twist
    return kind


def twist_of(velocity: Velocity, kind: type[Any]) -> Twist | TwistStamped:
    """Return a message of this class. A stamp is this computer's time: controllers refuse old ones."""
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.z = map(float, velocity)
    if kind is Twist:
        return twist
    stamped = TwistStamped(twist=twist)
    stamp = stamped.header.stamp
    stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
    return stamped


class _NotRead(ReentrantCallbackGroup):  # type: ignore[misc]
    """Lets no executor read."""

    def can_execute(self, entity: Any) -> bool:
        """Return False."""
        return False


_NOT_READ = _NotRead()


def cancel_client(node: Node, action: str) -> Any:
    """Return a client that cancels goals of an action. Its answers, which may have any size, are never read."""
    service = f"{action}/_action/cancel_goal"
    return node.create_client(CancelGoal, service, qos_profile=ONE_ANSWER, callback_group=_NOT_READ)


def cancel_goals(clients: Iterable[Any], goal: bytes = bytes(16)) -> None:
    """Cancel one goal of these actions; without an id all goals, from any sender (zero id and zero stamp)."""
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = np.frombuffer(goal, np.uint8)
    for client in clients:
        try:
            if client.service_is_ready():
                # Nobody reads the answer: a server that never answers must not leave one waiting for each stop.
                client.remove_pending_request(client.call_async(request))
        except Exception:  # the other actions' goals are cancelled all the same
            log.exception("goals of one action were not cancelled")
