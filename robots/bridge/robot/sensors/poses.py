"""Poses of messages in the plane."""

from __future__ import annotations

from typing import Any

from robots.shared.geometry.poses import Pose
from robots.shared.geometry.quaternions import yaw_of


def planar_pose(pose: Any) -> Pose:
    """Return the pose in the plane of a geometry_msgs/Pose; its yaw is NaN if the orientation is not finite."""
    turn = pose.orientation
    return Pose(pose.position.x, pose.position.y, yaw_of(turn.x, turn.y, turn.z, turn.w))
