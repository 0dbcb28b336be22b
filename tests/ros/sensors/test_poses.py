"""Poses in messages: orientations that drivers never fill, or do not normalise."""

from __future__ import annotations

import math

import pytest
from nav_msgs.msg import Odometry

from robots.bridge.ros.sensors.convert import planar

HALF = math.radians(50.0) / 2.0


@pytest.mark.parametrize(
    ("turn", "yaw"),
    [
        ((0.0, 0.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, math.sin(HALF), math.cos(HALF)), math.radians(50.0)),
        ((0.0, 0.0, 9.0 * math.sin(HALF), 9.0 * math.cos(HALF)), math.radians(50.0)),
        ((0.0, 0.0, -0.2 * math.sin(HALF), -0.2 * math.cos(HALF)), math.radians(50.0)),
        ((0.0, 0.0, math.nan, 1.0), math.nan),
        ((0.0, 0.0, 0.0, math.inf), math.nan),
    ],
)
def test_the_heading_of_odometry_is_read_from_any_quaternion(turn, yaw):
    message = Odometry()
    orientation = message.pose.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = turn
    pose, _ = planar(message)
    assert pose.yaw == pytest.approx(yaw, nan_ok=True)
