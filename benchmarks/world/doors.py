"""Doors: what a competent driver loses by the gate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure
from benchmarks.world.drivers import Follower
from benchmarks.world.loop import Case
from benchmarks.world.play import loop_of, played
from robots.simulator.physics import Pose
from robots.simulator.worlds import Wall, World

AT_M = 2.0
LONGEST_S = 40.0
# Width in metres: the share of the speed at which a competent driver takes it, and the ratio of times allowed.
DOORS = {0.90: (0.5, 1.02), 0.80: (0.5, 1.02), 0.70: (0.4, 1.03), 0.64: (0.3, 1.15)}
CONTROLLERS = ("none", "gate", "cone", "monitor")


class Passage(NamedTuple):
    """Which case."""

    controller: str
    width_m: float
    seed: int


class Outcome(NamedTuple):
    """What came of it: seconds of the course, or the reason why there are none."""

    touched: bool
    arrived: bool
    time_s: float


def measure(repeats: int) -> list[Figure]:
    """Time with the gate by time without it, over the courses that are driven without a contact when nobody helps."""
    jobs = [
        Passage(name, width, seed)
        for width in DOORS
        for name in CONTROLLERS
        for seed in range(max(repeats, 5))
    ]
    done = dict(played("doors", jobs, play))
    figures = []
    for width, (_, limit) in DOORS.items():
        seeds = [seed for seed in range(max(repeats, 5)) if _good(done[Passage("none", width, seed)])]
        alone_s = sum(done[Passage("none", width, seed)].time_s for seed in seeds)
        for name in CONTROLLERS[1:]:
            outcomes = [done[Passage(name, width, seed)] for seed in seeds]
            ours, where = name == "gate", f"door of {width:.2f} m, {name}"
            ratio = sum(outcome.time_s for outcome in outcomes) / alone_s if seeds else float("nan")
            stuck = sum(not _good(outcome) for outcome in outcomes)
            figures.append(Figure(f"{where}: time / time without", ratio, "", limit if ours else None))
            figures.append(Figure(f"{where}: not through of {len(seeds)}", stuck, "", 0.0 if ours else None))
    return figures


def _good(outcome: Outcome) -> bool:
    return outcome.arrived and not outcome.touched


def play(passage: Passage) -> Outcome:
    """Play one."""
    trace = loop_of(build(passage.width_m, passage.seed), passage.controller, passage.seed).play()
    return Outcome(bool(trace.touches), trace.arrived, trace.time_s)


def build(width_m: float, seed: int) -> Case:
    """The case: from one side, a little off, through the middle of the door."""
    random = np.random.default_rng([seed, 33])
    share, _ = DOORS[width_m]
    half = width_m / 2.0
    walls = [
        Wall(name=f"{side} wall", start=(AT_M, sign * half), end=(AT_M, sign * 3.0), thickness=0.12)
        for side, sign in (("left", 1.0), ("right", -1.0))
    ]
    start = Pose(0.0, float(random.uniform(-0.3, 0.3)), float(random.uniform(-0.3, 0.3)))
    points = [(AT_M - 0.7, 0.0), (AT_M + 0.5, 0.0), (AT_M + 1.5, 0.0)]
    return Case(
        World(name="door", size=(-4.0, -4.0, 6.0, 4.0), walls=walls),
        start,
        lambda _: Follower(points, share),
        longest_s=LONGEST_S,
        at_rest_s=LONGEST_S,
    )
