"""The driven wheels of a differential base, as their encoders measure them. Metres, radians, seconds."""

from __future__ import annotations

from robots.simulator.physics.base import Twist
from robots.simulator.sensors.body import WheelBase

LEFT = "wheel_left_joint"
RIGHT = "wheel_right_joint"


class Wheels:
    """Angles and speeds, integrated from the wheels' rolling speed, with or without slip."""

    def __init__(self, base: WheelBase) -> None:
        self._base = base
        self.positions = {LEFT: 0.0, RIGHT: 0.0}
        self.velocities = {LEFT: 0.0, RIGHT: 0.0}

    def step(self, rolled: Twist, dt: float) -> None:
        """Roll for `dt` seconds; `rolled` is the base's motion without slip."""
        outwards_mps = rolled.w * self._base.separation_m / 2.0
        self.velocities = {
            LEFT: (rolled.vx - outwards_mps) / self._base.radius_m,
            RIGHT: (rolled.vx + outwards_mps) / self._base.radius_m,
        }
        for name, speed in self.velocities.items():
            self.positions[name] += speed * dt
