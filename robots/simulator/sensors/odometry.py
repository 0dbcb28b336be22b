"""Odometry that drifts like that of real wheels.

Each run draws small constant scale errors (the driver's wheel radius and separation are never exact),
and random slip that grows with the distance travelled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose


class Drift(NamedTuple):
    """Standard deviations: scale errors without unit, slip per square root of a metre or radian."""

    linear_scale: float = 0.005
    angular_scale: float = 0.01
    slip_m: float = 0.002
    slip_rad: float = 0.004
    linear_off: float = 0.0  # constant scale errors, added to the drawn ones
    angular_off: float = 0.0

    def times(self, factor: float) -> Drift:
        """Return this drift, `factor` times as strong."""
        return Drift(*(value * factor for value in self))


class Odometry:
    """Integrates the wheels' velocity from (0, 0, 0), with drift."""

    def __init__(self, drift: Drift, random: np.random.Generator) -> None:
        self.x = 0.0
        self.y = 0.0
        self.yaw = 0.0
        self.velocity = Twist()
        self._drift = drift
        self._random = random
        self._linear = 1.0 + drift.linear_off + drift.linear_scale * float(random.standard_normal())
        self._angular = 1.0 + drift.angular_off + drift.angular_scale * float(random.standard_normal())

    @property
    def pose(self) -> Pose:
        """The robot's pose in the odometry frame."""
        return Pose(self.x, self.y, self.yaw)

    def step(self, wheels: Twist, dt: float) -> None:
        """Integrate the wheels' velocity `wheels` for `dt` seconds."""
        ahead = self._travelled(wheels.vx * dt, self._linear, self._drift.slip_m)
        left = self._travelled(wheels.vy * dt, self._linear, self._drift.slip_m)
        turned = self._travelled(wheels.w * dt, self._angular, self._drift.slip_rad)
        middle = self.yaw + turned / 2.0
        self.x += ahead * math.cos(middle) - left * math.sin(middle)
        self.y += ahead * math.sin(middle) + left * math.cos(middle)
        self.yaw = math.remainder(self.yaw + turned, math.tau)
        self.velocity = Twist(wheels.vx * self._linear, wheels.vy * self._linear, wheels.w * self._angular)

    def _travelled(self, true: float, scale: float, slip: float) -> float:
        if true == 0.0:
            return 0.0
        return true * scale + slip * math.sqrt(abs(true)) * float(self._random.standard_normal())
