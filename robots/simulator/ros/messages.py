"""Messages that several topics have in common."""

from __future__ import annotations

import math
from typing import Any

import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from nav_msgs.msg import Odometry

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose


def stamped(message: Any, stamp: rospy.Time, frame: str) -> Any:
    """Set the time and frame of a message; return the message."""
    message.header.stamp = stamp
    message.header.frame_id = frame
    return message


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return the rotation by `yaw` about the vertical."""
    return Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))


def odometry(pose: Pose, velocity: Twist, child: str) -> Odometry:
    """Return the pose and the velocity of frame `child`, without time and frame."""
    message = Odometry(child_frame_id=child)
    message.pose.pose.position.x = pose.x
    message.pose.pose.position.y = pose.y
    message.pose.pose.orientation = yaw_quaternion(pose.yaw)
    message.twist.twist.linear.x = velocity.vx
    message.twist.twist.linear.y = velocity.vy
    message.twist.twist.angular.z = velocity.w
    return message


def transform(child: str, at: Vector3, turned: Quaternion) -> TransformStamped:
    """Return the transform of frame `child`, without time and parent frame."""
    message = TransformStamped(child_frame_id=child)
    message.transform.translation = at
    message.transform.rotation = turned
    return message
