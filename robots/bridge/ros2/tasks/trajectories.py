"""Trajectories of joints with one point."""

from __future__ import annotations

from collections.abc import Mapping

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def trajectory(joints: Mapping[str, float], seconds: float) -> JointTrajectory:
    """Return the way to these positions (rad or m). Its stamp is zero: it begins when it arrives."""
    point = JointTrajectoryPoint(positions=[float(position) for position in joints.values()])
    whole, part = divmod(seconds, 1.0)
    point.time_from_start.sec, point.time_from_start.nanosec = int(whole), int(part * 1e9)
    return JointTrajectory(joint_names=list(joints), points=[point])
