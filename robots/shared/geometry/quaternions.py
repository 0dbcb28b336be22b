"""Quaternions as the robot's nodes send them: often zero, or not of length 1. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

LEAST = 1e-6  # a shorter quaternion has no direction: it stands for no rotation, as in RViz


class Quaternion(NamedTuple):
    """A rotation: a quaternion of length 1."""

    x: float
    y: float
    z: float
    w: float

    @property
    def yaw(self) -> float:
        """The heading, in radians, seen from above."""
        x, y, z, w = self
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    @property
    def tilt(self) -> float:
        """The angle between its z axis and the vertical, in radians."""
        return 2.0 * math.asin(min(math.hypot(self.x, self.y), 1.0))


IDENTITY = Quaternion(0.0, 0.0, 0.0, 1.0)


def rotation(x: float, y: float, z: float, w: float) -> Quaternion | None:
    """Return the rotation of a sent quaternion of any length; no rotation for zero; None if it is not finite."""
    length = math.hypot(x, y, z, w)
    if not math.isfinite(length):
        return None
    return Quaternion(x / length, y / length, z / length, w / length) if length >= LEAST else IDENTITY


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the heading of a sent quaternion, in radians; NaN if it is not finite."""
    found = rotation(x, y, z, w)
    return math.nan if found is None else found.yaw
