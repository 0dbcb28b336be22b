"""Drivers: models of a person at the stick."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.world.loop import RELEASED, Seen, Stick
from robots.shared.geometry.planar import wrapped
from robots.simulator.physics.mujoco_world import Pose

FACES_RAD = 0.03


class FullStick:
    """Holds the stick fully from `from_s` on."""

    def __init__(self, x: float, w: float, share: float, from_s: float = 0.0) -> None:
        self._stick = Stick(x, w, share)
        self._from_s = from_s

    def hold(self, seen: Seen) -> Stick | None:
        return RELEASED if seen.time_s < self._from_s else self._stick


class Approach:
    """Drives to the origin, turns to heading 0, lets the stick rest a moment, then holds it fully."""

    _SHARE = 0.3
    _REST_S = 0.6
    _PATIENCE_S = 9.0  # time limit of the approach

    def __init__(self, x: float, w: float, share: float) -> None:
        self._stick = Stick(x, w, share)
        self._coming = self._turning = True
        self._rests_until_s = 0.0

    def hold(self, seen: Seen) -> Stick | None:
        if self._coming:
            x, y, yaw = seen.pose
            left_m = -x * math.cos(yaw) - y * math.sin(yaw)
            self._coming = left_m > 0.01 and seen.time_s < self._PATIENCE_S
            return Stick(min(max(4.0 * left_m, 0.2), 1.0), 0.0, self._SHARE, trying=False)
        if self._turning:
            off = wrapped(-seen.pose.yaw)
            self._turning = abs(off) > FACES_RAD
            self._rests_until_s = seen.time_s + self._REST_S
            return Stick(0.0, min(max(1.2 * off, -0.6), 0.6), trying=False)
        return RELEASED if seen.time_s < self._rests_until_s else self._stick


class TurnAndGo:
    """Turns on the spot to a heading, lets the stick rest a moment, then holds it fully ahead."""

    _REST_S = 0.6
    _PATIENCE_S = 7.0  # time limit of the turn

    def __init__(self, heading: float, share: float) -> None:
        self._heading = heading
        self._stick = Stick(1.0, 0.0, share)
        self._turning = True
        self._rests_until_s = 0.0

    def hold(self, seen: Seen) -> Stick | None:
        if self._turning:
            off = wrapped(self._heading - seen.pose.yaw)
            self._turning = abs(off) > FACES_RAD and seen.time_s < self._PATIENCE_S
            self._rests_until_s = seen.time_s + self._REST_S
            return Stick(0.0, min(max(1.2 * off, -0.6), 0.6), trying=False)
        return RELEASED if seen.time_s < self._rests_until_s else self._stick


class Restless:
    """Adversarial: after a look around, holds random stick positions, often full ones, each for a moment.

    Half of the way is in reverse.
    """

    _LOOK_AROUND_S = 4.0
    _REVERSE = 0.85  # share of the time: reverse is slower, so this is half of the way

    def __init__(self, random: np.random.Generator, *, looks: bool = True) -> None:
        self._random = random
        self._looks_until_s = self._LOOK_AROUND_S if looks else 0.0
        self._stick = RELEASED
        self._until_s = 0.0

    def hold(self, seen: Seen) -> Stick | None:
        if seen.time_s < self._looks_until_s:
            return Stick(0.0, 1.0, 1.0, trying=False)
        if seen.time_s >= self._until_s:
            drawn, back = self._drawn(), self._random.random() < self._REVERSE
            self._stick = drawn._replace(x=-abs(drawn.x) if back else abs(drawn.x))
            self._until_s = seen.time_s + float(self._random.uniform(0.2, 2.5))
        return self._stick

    def _drawn(self) -> Stick:
        random = self._random
        if random.random() < 0.5:
            angle = float(random.choice(np.arange(0.0, 360.0, 45.0)))
            return Stick(round(math.cos(math.radians(angle)), 6), round(math.sin(math.radians(angle)), 6))
        x, w = random.uniform(-1.0, 1.0, 2)
        return Stick(float(x), float(w), float(random.uniform(0.3, 1.0)))


class Follower:
    """Competent: drives through points one after the other, and sees the robot's pose with a short delay."""

    _LAG_STEPS = 2  # delay of the seen pose, in periods of decisions
    _NEAR_M = 0.15

    def __init__(self, points: list[tuple[float, float]], share: float) -> None:
        self._points = points
        self._share = share
        self._poses: list[Pose] = []

    def hold(self, seen: Seen) -> Stick | None:
        self._poses = [*self._poses[-self._LAG_STEPS :], seen.pose]
        pose = self._poses[0]
        while (
            self._points
            and math.hypot(self._points[0][0] - pose.x, self._points[0][1] - pose.y) < self._NEAR_M
        ):
            self._points = self._points[1:]
        if not self._points:
            return None
        dx, dy = self._points[0][0] - pose.x, self._points[0][1] - pose.y
        off = wrapped(math.atan2(dy, dx) - pose.yaw)
        turn = min(max(1.5 * off / self._share / 2.0944, -1.0), 1.0)
        ahead = max(math.cos(2.0 * off), 0.0) if abs(off) < 0.8 else 0.0
        return Stick(ahead, turn, self._share)
