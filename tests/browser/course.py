"""A course through the 0.80 m door, and a driver who follows the course by odometry, with stick or keys."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robots.shared.geometry.planar import wrapped

START = (1.7, 1.7, 0.0)  # in the office: x, y, heading in degrees; zero of odometry
# Points before, in and behind the door; metres from the start.
COURSE = ((0.8, 0.8), (0.8, 1.8), (0.8, 2.25))
THERE_M = 0.15
DEAD_ZONE = 0.08  # dead zone of the page's stick
ASTRAY_RAD = 0.5  # above this angle, the driver turns on the spot
TURN_PER_RAD = 2.0
AIM_RAD = 0.06  # below this angle, the driver releases the key
SHARE = 0.4


class Follower:
    """Moves the stick like a good driver: forward and left turn, each -1..1."""

    def __init__(self, course: Sequence[tuple[float, float]] = COURSE) -> None:
        self._course = list(course)

    @property
    def arrived(self) -> bool:
        """True at the end of the course."""
        return not self._course

    def stick(self, x: float, y: float, yaw: float) -> tuple[float, float]:
        """Return the stick position for this pose by odometry."""
        while self._course and math.dist((x, y), self._course[0]) < THERE_M:
            del self._course[0]
        if not self._course:
            return 0.0, 0.0
        goal_x, goal_y = self._course[0]
        astray = wrapped(math.atan2(goal_y - y, goal_x - x) - yaw)
        forward = 0.0 if abs(astray) > ASTRAY_RAD else 1.0
        return forward, min(max(TURN_PER_RAD * astray, -1.0), 1.0)


def pushed(axis: float) -> float:
    """Return the joystick deflection for this stick value: inverse of the curve in static/js/drive/input/shaping.js."""
    wanted, low, high = abs(axis), 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2.0
        low, high = (middle, high) if 0.5 * middle + 0.5 * middle**3 < wanted else (low, middle)
    return math.copysign(DEAD_ZONE + (1.0 - DEAD_ZONE) * high if wanted else 0.0, axis)


def keys(forward: float, turn: float) -> tuple[float, float]:
    """Return this stick position as keys, which are on or off."""
    return forward, 0.0 if abs(turn) < TURN_PER_RAD * AIM_RAD else math.copysign(1.0, turn)
