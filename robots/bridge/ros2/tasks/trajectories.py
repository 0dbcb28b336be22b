"""Trajectories of joints with one point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def trajectory(joints: Mapping[str, float], seconds: float) -> JointTrajectory:
    """Return the way to these positions (rad or m). Its stamp is zero: it begins when it arrives."""
    point = JointTrajectoryPoint(positions=[float(position) for position in joints.values()])
    fill_duration(point.time_from_start, seconds)
    return JointTrajectory(joint_names=list(joints), points=[point])


def fill_duration(message: Any, seconds: float) -> None:
    """Write a duration into a builtin_interfaces/Duration."""
    whole, part = divmod(seconds, 1.0)
    message.sec, message.nanosec = int(whole), int(part * 1e9)
