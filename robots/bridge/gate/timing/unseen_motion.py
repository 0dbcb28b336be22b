"""How far the robot may have moved while its odometry was silent (docs/gate.md, 7).

After a gap the odometry goes on in the same frame, but it may have missed the motion in the gap. The robot moved at
most at its fastest speed before, during and after the gap: measured, or commanded. It moved until the last command
lost its effect and the base had braked. If it moves without commands of this console (navigation, a joystick), it may
have moved and accelerated during the whole gap.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.timing.latency import LONGEST_S
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.arc import speed
from robots.shared.geometry.planar import wrapped
from robots.shared.geometry.poses import STILL, Pose, Velocity

Floats = NDArray[np.float64]

# A base counts as standing up to this speed, and a person who leans on it may push it so slowly.
CREEPS_MPS, CREEPS_RADPS = 0.01, 0.01
MOST_CREPT_M, MOST_CREPT_RAD = 0.10, 0.10  # wheels that turned more show it when the odometry is back
KEPT_S = 3.0  # for this time after a command, its effect and the braking may last


class Doubt(NamedTuple):
    """The largest error of a pose: metres, and radians of its yaw."""

    metres: float
    radians: float

    def at(self, distances_m: Floats) -> Floats:
        """Return the largest error (m) of places at these distances from the robot."""
        errors_m: Floats = self.metres + self.radians * distances_m
        return errors_m


class _Axis(NamedTuple):
    """Forward or turning motion of a base: speeds and rates of one axis."""

    fastest: float
    acceleration: float
    braking: float
    creeps: float
    most_crept: float


class UnseenMotion:
    """Keeps the commands that may have moved the robot since its newest odometry."""

    def __init__(self, limits: Limits, braking: tuple[float, float]) -> None:
        """`braking`: the usable decelerations, m/s^2 and rad/s^2."""
        fastest = math.hypot(max(limits.forward_mps, limits.reverse_mps), limits.lateral_mps)
        linear, angular = braking
        self._forward = _Axis(fastest, limits.linear_mps2, linear, CREEPS_MPS, MOST_CREPT_M)
        self._turning = _Axis(limits.turn_radps, limits.angular_radps2, angular, CREEPS_RADPS, MOST_CREPT_RAD)
        self._sent: deque[tuple[float, Velocity]] = deque()  # each is in effect until the next one
        self._moved_s = -math.inf  # arrival of the newest odometry
        self._velocity = STILL

    def sent(self, velocity: Velocity, now_s: float) -> None:
        """Take a published twist."""
        if not self._sent or self._sent[-1][1] != velocity:
            self._sent.append((now_s, velocity))

    def moved(self, velocity: Velocity, arrival_s: float) -> None:
        """Take the velocity of new odometry."""
        self._velocity, self._moved_s = velocity, arrival_s
        while len(self._sent) > 1 and self._sent[1][0] + KEPT_S < arrival_s:
            self._sent.popleft()

    def doubt(self, after: Velocity, arrival_s: float, missing_s: float) -> Doubt:
        """Return how far the robot may have moved since its newest odometry; `after` is its velocity now.

        `missing_s` of motion are missing: less than the silence if late messages came in a burst.
        """
        gap_s = arrival_s - self._moved_s
        times = [sent_s - self._moved_s for sent_s, _ in self._sent]
        before = self._velocity
        forward = [speed(sent) for _, sent in self._sent]
        turning = [abs(sent.w) for _, sent in self._sent]
        way_m = _longest_way(self._forward, times, forward, speed(before), speed(after), gap_s)
        turn_rad = _longest_way(self._turning, times, turning, abs(before.w), abs(after.w), gap_s)
        return Doubt(
            min(way_m, self._forward.fastest * missing_s), min(turn_rad, self._turning.fastest * missing_s)
        )


def _longest_way(
    axis: _Axis, times: list[float], asked: list[float], before: float, after: float, gap_s: float
) -> float:
    """Return the longest way of one axis in a gap that begins at time 0.

    `times`, `asked`: when each speed was commanded. `before`, `after`: the measured speeds at both ends.
    """
    ends = [*times[1:], gap_s][: len(times)]
    moving = [(speed, end_s + LONGEST_S) for speed, end_s in zip(asked, ends, strict=True) if speed]
    peak = max([before, after, *(speed for speed, until_s in moving if until_s > 0.0)])
    stands_s = max((until_s for _, until_s in moving), default=-math.inf) + peak / axis.braking
    if (before > axis.creeps and stands_s < 0.0) or (after > axis.creeps and stands_s < gap_s):
        return min(peak + axis.acceleration * gap_s / 2.0, axis.fastest) * gap_s  # others command it
    crept = min(axis.creeps * gap_s, axis.most_crept)
    return peak * min(max(stands_s, 0.0), gap_s) + crept


def difference(one: Pose, other: Pose) -> Doubt:
    """Return by how much two poses differ."""
    return Doubt(math.hypot(one.x - other.x, one.y - other.y), abs(wrapped(one.yaw - other.yaw)))
