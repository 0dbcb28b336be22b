"""From ROS messages to the gate's values."""

from __future__ import annotations

import math
from typing import Any

from robots.bridge.gate.values import Pose, Velocity


def planar(odometry: Any) -> tuple[Pose, Velocity]:
    """Pose and velocity in the plane of a nav_msgs/Odometry."""
    position, q, twist = odometry.pose.pose.position, odometry.pose.pose.orientation, odometry.twist.twist
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return Pose(position.x, position.y, yaw), Velocity(twist.linear.x, twist.linear.y, twist.angular.z)
