"""Converts ROS messages to the gate's values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robots.bridge.gate.values import LaserScan, Pose, Velocity


def planar(odometry: Any) -> tuple[Pose, Velocity]:
    """Return pose and velocity in the plane of a nav_msgs/Odometry."""
    position, q, twist = odometry.pose.pose.position, odometry.pose.pose.orientation, odometry.twist.twist
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return Pose(position.x, position.y, yaw), Velocity(twist.linear.x, twist.linear.y, twist.angular.z)


def laser_scan(scan: Any, source: str, arrival_s: float) -> LaserScan:
    """Return the gate's scan of a sensor_msgs/LaserScan from this source."""
    return LaserScan(
        source,
        scan.header.stamp.to_sec(),
        arrival_s,
        np.asarray(scan.ranges, dtype=np.float32),
        scan.angle_min,
        scan.angle_increment,
        scan.range_min,
        scan.range_max,
    )
