"""Messages that several topics have in common."""

from __future__ import annotations

import math
from typing import Any

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.ros_side import RosSide


def yaw_quaternion(ros: RosSide, yaw: float) -> Any:
    """Return the rotation by `yaw` about the vertical."""
    return ros.new("geometry_msgs/Quaternion", z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))


def odometry(ros: RosSide, pose: Pose, velocity: Twist, child: str) -> Any:
    """Return the pose and the velocity of frame `child`, without time and frame."""
    message = ros.new("nav_msgs/Odometry", child_frame_id=child)
    message.pose.pose.position.x = pose.x
    message.pose.pose.position.y = pose.y
    message.pose.pose.orientation = yaw_quaternion(ros, pose.yaw)
    message.twist.twist.linear.x = velocity.vx
    message.twist.twist.linear.y = velocity.vy
    message.twist.twist.angular.z = velocity.w
    return message


def transform(ros: RosSide, child: str, at: tuple[float, float, float], turned: Any) -> Any:
    """Return the transform of frame `child`, without time and parent frame."""
    message = ros.new("geometry_msgs/TransformStamped", child_frame_id=child)
    x, y, z = at
    message.transform.translation = ros.new("geometry_msgs/Vector3", x=x, y=y, z=z)
    message.transform.rotation = turned
    return message


def pose_of(message: Any) -> Pose | None:
    """Return a pose on the floor; None if numbers are not finite, or the rotation is not about the vertical."""
    turn = message.orientation
    numbers = (message.position.x, message.position.y, turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, numbers)) or abs(math.hypot(turn.z, turn.w) - 1.0) > 0.01:
        return None
    return Pose(message.position.x, message.position.y, 2.0 * math.atan2(turn.z, turn.w))
