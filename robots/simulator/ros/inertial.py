"""The base's inertial unit and the wrist's force sensor: simple messages, cheap without subscribers."""

from __future__ import annotations

import numpy as np
import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import Imu

from robots.simulator.robot import TICK_S, Robot
from robots.simulator.ros.messages import stamped, yaw_quaternion

_GRAVITY_MPS2 = 9.81
_GYRO_SIGMA_RADPS = 0.005
_ACCELERATION_SIGMA_MPS2 = 0.05
_HAND_N = -7.0  # the gripper's own weight
_FORCE_SIGMA_N = 0.1


class InertialTopics:
    """/base_imu and, with an arm, /wrist_ft."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._random = np.random.default_rng(0)
        self._imu = rospy.Publisher("/base_imu", Imu, queue_size=1)
        self._wrist = rospy.Publisher("/wrist_ft", WrenchStamped, queue_size=1)

    def publish(self, stamp: rospy.Time) -> None:
        """Publish both sensors."""
        if self._imu.get_num_connections():
            self._imu.publish(self._felt_by_base(stamp))
        if self._robot.body.upper_body and self._wrist.get_num_connections():
            message = stamped(WrenchStamped(), stamp, "wrist_ft_link")
            message.wrench.force.z = _HAND_N + self._noise(_FORCE_SIGMA_N)
            self._wrist.publish(message)

    def _felt_by_base(self, stamp: rospy.Time) -> Imu:
        physics = self._robot.physics
        gained = physics.velocity.vx - self._robot.approach.vx
        message = stamped(Imu(), stamp, "base_imu_link")
        message.orientation = yaw_quaternion(physics.pose.yaw)
        message.angular_velocity.z = physics.velocity.w + self._noise(_GYRO_SIGMA_RADPS)
        message.linear_acceleration.x = gained / TICK_S + self._noise(_ACCELERATION_SIGMA_MPS2)
        message.linear_acceleration.z = _GRAVITY_MPS2 + self._noise(_ACCELERATION_SIGMA_MPS2)
        return message

    def _noise(self, sigma: float) -> float:
        return sigma * float(self._random.standard_normal())
