"""The mobile base controller: limits, accelerations and time-out, without ROS or physics.

It turns the last command into the velocity that the wheels are asked for now, as PAL's
diff_drive_controller does: clamp to the velocity limits, then to the accelerations, and brake to zero when no command came for
`timeout_s`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Twist(NamedTuple):
    """Planar velocity in the base frame: m/s forward, m/s left, rad/s counter-clockwise."""

    vx: float = 0.0
    vy: float = 0.0
    w: float = 0.0


STILL = Twist()


@dataclass(frozen=True)
class BaseLimits:
    """What the controller lets through: m/s, rad/s, m/s^2, rad/s^2."""

    forward_mps: float = 1.0
    reverse_mps: float = 0.2
    lateral_mps: float = 0.0
    turn_radps: float = 2.0944
    linear_mps2: float = 1.0
    angular_radps2: float = 2.0944
    timeout_s: float = 0.25


TIAGO = BaseLimits()


def clamp(value: float, low: float, high: float) -> float:
    """`value`, held between `low` and `high`."""
    return min(max(value, low), high)


class BaseController:
    """Follows the newest command within the limits. Times are seconds of one clock."""

    def __init__(self, limits: BaseLimits = TIAGO) -> None:
        self.limits = limits
        self.velocity = STILL
        self._command = STILL
        self._commanded_at = float("-inf")

    def command(self, twist: Twist, now: float) -> None:
        """A new command arrived."""
        self._command = twist
        self._commanded_at = now

    def step(self, now: float, dt: float) -> Twist:
        """The velocity to ask of the wheels for the next `dt` seconds."""
        wanted = self._within_limits(self._command) if self._is_fresh(now) else STILL
        linear = self.limits.linear_mps2 * dt
        angular = self.limits.angular_radps2 * dt
        before = self.velocity
        self.velocity = Twist(
            clamp(wanted.vx, before.vx - linear, before.vx + linear),
            clamp(wanted.vy, before.vy - linear, before.vy + linear),
            clamp(wanted.w, before.w - angular, before.w + angular),
        )
        return self.velocity

    def _is_fresh(self, now: float) -> bool:
        return now - self._commanded_at <= self.limits.timeout_s

    def _within_limits(self, twist: Twist) -> Twist:
        limits = self.limits
        return Twist(
            clamp(twist.vx, -limits.reverse_mps, limits.forward_mps),
            clamp(twist.vy, -limits.lateral_mps, limits.lateral_mps),
            clamp(twist.w, -limits.turn_radps, limits.turn_radps),
        )
