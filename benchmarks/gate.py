"""What the safety gate costs per decision, with few and many points in reach, disc and polygon."""

from __future__ import annotations

import math
import time
from collections import deque

import numpy as np

from benchmarks.harness import Figure, progress, quantile
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import STILL, GateProfile, Limits, Pose, Velocity

DECISIONS = 3000
HELD = 40  # decisions with one stick: 0.8 s
LASER = "laser"
FIELD_OF_VIEW = math.radians(190)
Outline = tuple[tuple[float, float], ...]
BOX: Outline = ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25))
# Straight on, on an arc, and while the base still turns the other way: what a decision looks at grows.
STICKS = (Velocity(1.0, 0.0, 0.0), Velocity(0.8, 0.0, 1.2), Velocity(1.0, 0.0, -2.0))


def measure() -> list[Figure]:
    """Decisions at 50 Hz with new odometry before each, roll-out and all: p50 and p99 of the computing time.

    Not of the time that passes: what other processes take is not the gate's cost.
    """
    figures = []
    for hull, outline, limit_us in (("disc", None, 300.0), ("polygon", BOX, 300.0)):
        for where, points, nearest_m, farthest_m in (
            ("in a room", 700, 1.0, 6.0),
            ("all in reach", 700, 0.45, 1.0),
            ("all in reach", 2000, 0.45, 1.0),
        ):
            name = f"{hull}, {points} points {where}"
            progress(name)
            spent_us = _decisions(_Clutter(outline, points, nearest_m, farthest_m))
            half_us = limit_us if points == 700 else 800.0
            figures.append(Figure(f"{name}: p50", quantile(spent_us, 0.5), "us", half_us))
            figures.append(Figure(f"{name}: p99", quantile(spent_us, 0.99), "us", 1000.0))
    return figures


class _Clutter:
    """A gate, and a clutter of objects seven beams wide that its laser sees."""

    def __init__(self, outline: Outline | None, points: int, nearest_m: float, farthest_m: float) -> None:
        objects = np.random.default_rng(1).uniform(nearest_m, farthest_m, points // 7 + 1)
        self._ranges = objects.repeat(7)[:points]
        self._increment = FIELD_OF_VIEW / (points - 1)
        self.gate = Gate(
            GateProfile(
                limits=Limits(1.0, 0.2, 0.0, 2.0944, 1.0, 2.0944),
                radius_m=0.27,
                outline=outline,
                scan_poses={LASER: (0.2, 0.0, 0.0)},
                sonar_poses={},
                sonar_fov={},
                has_depth=False,
                blind_mps=2.0,  # nothing is held back before the points are looked at
            )
        )

    def observe(self, turn: int, now_s: float, velocity: Velocity) -> None:
        """Odometry at 50 Hz, the laser at 10 Hz."""
        moved = Pose(1e-5 * (turn % 100), 0.0, 0.0)
        self.gate.observe_odometry(now_s, now_s, moved, velocity)
        if turn % 5 == 0:
            start = -FIELD_OF_VIEW / 2.0
            self.gate.observe_scan(LASER, now_s, now_s, self._ranges, start, self._increment, 0.05, 25.0)


def _decisions(clutter: _Clutter) -> list[float]:
    """Microseconds of each decision, none of them cut short; the base does what is sent 0.1 s later."""
    spent_us = []
    on_its_way = deque([STILL] * 5)
    for turn in range(DECISIONS):
        stick, now_s = STICKS[turn // HELD % len(STICKS)], 1.0 + turn / 50.0
        clutter.observe(turn, now_s, on_its_way.popleft())
        before = time.thread_time()
        verdict = clutter.gate.decide(stick, on_its_way[-1], now_s)
        spent_us.append(1e6 * (time.thread_time() - before))
        on_its_way.append(verdict.velocity)
        if verdict.neutral:
            raise RuntimeError(f"the gate saw nothing to decide upon: {verdict.text}")
    return spent_us
