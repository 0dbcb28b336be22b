"""A course through the 0.80 m door, and somebody who follows it: by what odometry says, with stick or keys."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robots.bridge.gate.geometry.planar import wrapped

START = (1.7, 1.7, 0.0)  # in the office: x, y, heading in degrees; odometry begins there
# Before the door, in it, behind it; from the start.
COURSE = ((0.8, 0.8), (0.8, 1.8), (0.8, 2.25))
THERE_M = 0.15
DEAD_ZONE = 0.08  # of the page's stick
ASTRAY_RAD = 0.5  # farther astray, a driver turns on the spot
TURN_PER_RAD = 2.0
AIM_RAD = 0.06  # a key is let go of within it
SHARE = 0.4


class Follower:
    """Where a competent driver holds the stick: forward and left turn, each -1..1."""

    def __init__(self, course: Sequence[tuple[float, float]] = COURSE) -> None:
        self._course = list(course)

    @property
    def arrived(self) -> bool:
        """The end is reached."""
        return not self._course

    def stick(self, x: float, y: float, yaw: float) -> tuple[float, float]:
        """For this pose by odometry."""
        while self._course and math.dist((x, y), self._course[0]) < THERE_M:
            del self._course[0]
        if not self._course:
            return 0.0, 0.0
        goal_x, goal_y = self._course[0]
        astray = wrapped(math.atan2(goal_y - y, goal_x - x) - yaw)
        forward = 0.0 if abs(astray) > ASTRAY_RAD else 1.0
        return forward, min(max(TURN_PER_RAD * astray, -1.0), 1.0)


def pushed(axis: float) -> float:
    """How far a thumb goes for this: the page's stick (static/js/drive/shaping.js) is fine near its middle."""
    wanted, low, high = abs(axis), 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2.0
        low, high = (middle, high) if 0.5 * middle + 0.5 * middle**3 < wanted else (low, middle)
    return math.copysign(DEAD_ZONE + (1.0 - DEAD_ZONE) * high if wanted else 0.0, axis)


def keys(forward: float, turn: float) -> tuple[float, float]:
    """The same with keys, which know no half."""
    return forward, 0.0 if abs(turn) < TURN_PER_RAD * AIM_RAD else math.copysign(1.0, turn)
