"""Converts ROS messages to the gate's values."""

from __future__ import annotations

from typing import Any

import numpy as np

from robots.bridge.gate.values import LaserScan
from robots.bridge.robot.sensors.poses import planar_pose
from robots.shared.geometry.poses import Pose, Velocity


def planar(odometry: Any) -> tuple[Pose, Velocity]:
    """Return pose and velocity in the plane of a nav_msgs/Odometry."""
    twist = odometry.twist.twist
    return planar_pose(odometry.pose.pose), Velocity(twist.linear.x, twist.linear.y, twist.angular.z)


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
