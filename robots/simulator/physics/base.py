"""The mobile base controller: limits, accelerations and time-out, without ROS or physics.

It turns the last command into the wheels' commanded velocity, as PAL's
diff_drive_controller does: clamp to the velocity limits, then to the accelerations, and brake to zero
when no command came for `timeout_s`.
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
    """Limits of the controller: m/s, rad/s, m/s^2, rad/s^2."""

    forward_mps: float = 1.0
    reverse_mps: float = 0.2
    lateral_mps: float = 0.0
    turn_radps: float = 2.0944
    linear_mps2: float = 1.0
    angular_radps2: float = 2.0944
    timeout_s: float = 0.25


TIAGO = BaseLimits()


def clamp(value: float, low: float, high: float) -> float:
    """Return `value`, limited to the range from `low` to `high`."""
    return min(max(value, low), high)


class BaseController:
    """Follows the newest command within the limits. Times are seconds of one clock."""

    def __init__(self, limits: BaseLimits = TIAGO) -> None:
        self.limits = limits
        self.velocity = STILL
        self.brake_share = 1.0  # below 1: worn brakes, for tests of braking
        self._command = STILL
        self._commanded_at = float("-inf")

    def command(self, twist: Twist, now: float) -> None:
        """Take a new command."""
        self._command = twist
        self._commanded_at = now

    def step(self, now: float, dt: float) -> Twist:
        """Return the wheels' velocity for the next `dt` seconds."""
        is_fresh = now - self._commanded_at <= self.limits.timeout_s
        wanted = self._within_limits(self._command) if is_fresh else STILL
        linear = self.limits.linear_mps2 * dt
        angular = self.limits.angular_radps2 * dt
        self.velocity = Twist(
            self._towards(wanted.vx, self.velocity.vx, linear),
            self._towards(wanted.vy, self.velocity.vy, linear),
            self._towards(wanted.w, self.velocity.w, angular),
        )
        return self.velocity

    def _towards(self, wanted: float, before: float, change: float) -> float:
        """Return `wanted`, at most `change` away from `before`, or less if worn brakes slow the robot."""
        if abs(wanted) < abs(before):
            change *= self.brake_share
        return clamp(wanted, before - change, before + change)

    def _within_limits(self, twist: Twist) -> Twist:
        limits = self.limits
        return Twist(
            clamp(twist.vx, -limits.reverse_mps, limits.forward_mps),
            clamp(twist.vy, -limits.lateral_mps, limits.lateral_mps),
            clamp(twist.w, -limits.turn_radps, limits.turn_radps),
        )
