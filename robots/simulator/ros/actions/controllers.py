"""The controllers' topic `state`."""

from __future__ import annotations

from robots.simulator.joints.trajectories import joints_of
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp


class ControllerState:
    """Where a controller's joints are."""

    def __init__(self, ros: RosSide, robot: Robot, name: str) -> None:
        self._ros = ros
        self._player = robot.player
        self._joints = joints_of(name)
        self._state = ros.publisher(f"/{name}/state", "control_msgs/JointTrajectoryControllerState")

    def publish(self, stamp: Stamp) -> None:
        """Publish the joints. They never lag: desired and actual are the same."""
        if not self._state.wanted:
            return
        there = self._point(
            [self._player.positions[joint] for joint in self._joints],
            [self._player.velocities[joint] for joint in self._joints],
        )
        none = [0.0] * len(self._joints)
        message = self._ros.new(
            "control_msgs/JointTrajectoryControllerState",
            joint_names=self._joints,
            desired=there,
            actual=there,
            error=self._point(none, none),
        )
        self._state.publish(self._ros.stamped(message, stamp))

    def _point(self, positions: list[float], velocities: list[float]) -> object:
        return self._ros.new(
            "trajectory_msgs/JointTrajectoryPoint", positions=positions, velocities=velocities
        )
