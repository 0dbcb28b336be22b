"""The base's inertial unit and the wrist's force sensor: simple messages, cheap without subscribers."""

from __future__ import annotations

from typing import Any

import numpy as np

from robots.simulator.robot import TICK_S, Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.topics.messages import yaw_quaternion

_GRAVITY_MPS2 = 9.81
_GYRO_SIGMA_RADPS = 0.005
_ACCELERATION_SIGMA_MPS2 = 0.05
_HAND_N = -7.0  # the gripper's own weight
_FORCE_SIGMA_N = 0.1


class InertialTopics:
    """/base_imu and, with an arm, /wrist_ft."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._random = np.random.default_rng(0)
        self._imu = ros.publisher("/base_imu", "sensor_msgs/Imu")
        self._wrist = ros.publisher("/wrist_ft", "geometry_msgs/WrenchStamped")

    def publish(self, stamp: Stamp) -> None:
        """Publish both sensors."""
        if self._imu.wanted:
            self._imu.publish(self._felt_by_base(stamp))
        if self._robot.body.upper_body and self._wrist.wanted:
            message = self._ros.stamped(self._ros.new("geometry_msgs/WrenchStamped"), stamp, "wrist_ft_link")
            message.wrench.force.z = _HAND_N + self._noise(_FORCE_SIGMA_N)
            self._wrist.publish(message)

    def _felt_by_base(self, stamp: Stamp) -> Any:
        physics = self._robot.physics
        gained = physics.velocity.vx - self._robot.approach.vx
        message = self._ros.stamped(self._ros.new("sensor_msgs/Imu"), stamp, "base_imu_link")
        message.orientation = yaw_quaternion(self._ros, physics.pose.yaw)
        message.angular_velocity.z = physics.velocity.w + self._noise(_GYRO_SIGMA_RADPS)
        message.linear_acceleration.x = gained / TICK_S + self._noise(_ACCELERATION_SIGMA_MPS2)
        message.linear_acceleration.z = _GRAVITY_MPS2 + self._noise(_ACCELERATION_SIGMA_MPS2)
        return message

    def _noise(self, sigma: float) -> float:
        return sigma * float(self._random.standard_normal())
