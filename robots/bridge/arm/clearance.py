"""Decide whether the arm has room for a motion: no obstacle in the space that it sweeps.

Laser and sonars do not see a moving arm, because it does not reach down to their height. The depth camera
sees it. So a depth point counts as an obstacle only if the joint positions show that the arm is not near it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate import words
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.arm.sweep import intruder
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import Kind, Obstacles
from robots.shared.sentences import say
from robots.shared.wire import Refusal

WATCH: tuple[Kind, ...] = ("scan", "depth")  # kinds of sensors that must work before the arm moves
WATCH_ARM: tuple[Kind, ...] = ("scan",)  # kinds that must work while the arm moves: it may block the camera
SEES_NO_ARM: tuple[Kind, ...] = ("scan", "memory", "sonar")
# Remembered points ("depth memory") may show the arm at an earlier moment.
SEES_ARM: tuple[Kind, ...] = ("depth",)
# s: a frame arrives some tenths of a second late and counts for half a second more.
LATELY_S = 1.0
# Margin around the arm's discs: its motion between two joint states, the width of the gripper, camera noise.
BESIDE_ARM_M = 0.10


class ArmModel(ABC):
    """Source of the arm's position."""

    @abstractmethod
    def arm(self) -> tuple[Disc, ...] | None:
        """Return the discs that the arm covers now; None if joint states or the robot's description are missing."""

    @abstractmethod
    def arm_problem(self) -> str:
        """Return in words why the arm's position is unknown now, but should be known; empty: it is known."""


class ArmClearance:
    """The free space around one robot's arm. While a motion runs, call `refuse` every tick."""

    def __init__(self, gate: Gate, arm: Callable[[], ArmModel | None]) -> None:
        self._gate = gate
        self._arm = arm
        # where the arm was recently, while it moves
        self._lately: deque[tuple[float, tuple[Disc, ...] | None]] = deque()
        self._known_s = -math.inf  # when nothing was wrong with the arm's position

    def refuse(self, space: Sequence[Disc], now_s: float, *, running: bool = False) -> Refusal | None:
        """Return why the arm may not sweep `space`, or not continue: an obstacle is there, or a sensor is missing."""
        arm = self._arm()
        problem = arm.arm_problem() if arm else ""
        if not running:
            self._lately.clear()
        if not running or not problem:
            self._known_s = now_s
        if not space:
            return None
        if problem and (not running or now_s - self._known_s > LATELY_S):
            why = say("Obstacles around the arm are unknown: {problem}.", problem=problem)
            return Refusal("not_watched", why, "gate", {"sensor": "arm"})
        obstacles = self._gate.obstacles(now_s)
        if not running:
            return self._unwatched(WATCH, now_s) or self._in_the_way(space, obstacles)
        self._follow_arm(now_s)
        return self._unwatched(WATCH_ARM, now_s) or self._in_the_way(space, self._but_for_arm(obstacles))

    def _unwatched(self, kinds: Collection[Kind], now_s: float) -> Refusal | None:
        """Return a refusal for the first sensor of these kinds that does not work."""
        for name, kind, ok, _, text in self._gate.sensor_health(now_s):
            if kind in kinds and not ok:
                why = say("Obstacles around the arm are unknown: {sensor}: {why}.", sensor=name, why=text)
                return Refusal("not_watched", why, "gate", {"sensor": name})
        return None

    def _in_the_way(self, space: Sequence[Disc], obstacles: Obstacles) -> Refusal | None:
        """Return a refusal if an obstacle is in the space that the arm sweeps."""
        gaps = self._gate.footprint.gaps(obstacles.points)
        found = intruder(space, obstacles, gaps, self._gate.arm_discs)
        if found is None:
            return None
        sensor, side = obstacles.names[found.source], words.side(found.bearing_rad)
        text = say(
            "An obstacle is in the arm’s way: {obstacle}.",
            obstacle=words.obstacle(sensor, found.gap_m, found.bearing_rad, ""),
        )
        gap_m = round(found.gap_m, 2)
        return Refusal("motion_blocked", text, "gate", {"sensor": sensor, "distance_m": gap_m, "side": side})

    def _follow_arm(self, now_s: float) -> None:
        arm = self._arm()
        self._lately.append((now_s, arm.arm() if arm else None))
        while now_s - self._lately[0][0] > LATELY_S:
            self._lately.popleft()

    def _but_for_arm(self, obstacles: Obstacles) -> Obstacles:
        """Return the obstacles without the points that may be the arm at a recent position."""
        rows = _of(obstacles, SEES_NO_ARM)
        arm = {disc for _, discs in self._lately for disc in discs or ()}
        if all(discs is not None for _, discs in self._lately):
            seen = np.flatnonzero(_of(obstacles, SEES_ARM))
            rows[seen] = ~_beside(obstacles.points[seen], arm)
        return obstacles._replace(points=obstacles.points[rows], source=obstacles.source[rows])


def _of(obstacles: Obstacles, kinds: Collection[Kind]) -> NDArray[np.bool_]:
    """Select obstacles from sensors of these kinds."""
    numbers = [number for number, kind in enumerate(obstacles.kinds) if kind in kinds]
    return np.isin(obstacles.source, numbers)


def _beside(points: NDArray[np.float64], arm: Collection[Disc]) -> NDArray[np.bool_]:
    """Select points within the arm's discs and their margin: they may be the arm."""
    x, y, radius = np.array([*arm]).reshape(-1, 3).T
    away = np.hypot(points[:, :1] - x, points[:, 1:] - y)
    near: NDArray[np.bool_] = (away < radius + BESIDE_ARM_M).any(axis=1)
    return near
