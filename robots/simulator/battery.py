"""The robot's battery: drains with time and faster with motion, charges when docked."""

from __future__ import annotations

from robots.simulator.physics.base import Twist, clamp

_IDLE_PERCENT_PER_S = 100.0 / (6 * 3600)
_DRIVING_PERCENT_PER_S = 100.0 / (3 * 3600)
_CHARGING_PERCENT_PER_S = 100.0 / (2 * 3600)


class Battery:
    """Charge in percent."""

    def __init__(self) -> None:
        self.percent = 87.0
        self.charging = False

    def step(self, velocity: Twist, dt: float) -> None:
        """Drain or charge for `dt` seconds."""
        if self.charging:
            change = _CHARGING_PERCENT_PER_S
        elif any(velocity):
            change = -_DRIVING_PERCENT_PER_S
        else:
            change = -_IDLE_PERCENT_PER_S
        self.percent = clamp(self.percent + change * dt, 0.0, 100.0)
