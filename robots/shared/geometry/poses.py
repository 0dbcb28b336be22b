"""Poses and velocities in the plane."""

from __future__ import annotations

from typing import NamedTuple


class Velocity(NamedTuple):
    """A planar twist in the base frame: m/s forward, m/s left, rad/s counter-clockwise."""

    vx: float
    vy: float
    w: float

    def scaled(self, share: float) -> Velocity:
        """Return the twist at this share of its speed, on the same arc."""
        return Velocity(*(share * axis + 0.0 for axis in self))  # + 0.0 makes -0.0 positive


STILL = Velocity(0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A planar pose: metres, radians."""

    x: float
    y: float
    yaw: float
