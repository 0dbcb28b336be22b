"""Doors: the time that a competent driver loses because of the gate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.cases.drawn import conditions_of, words_of
from benchmarks.world.drivers import Follower
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import loop_of, played
from benchmarks.world.sensors import DEPTH_SIZES, STANDARD, Sensors
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Wall, World

AT_M = 2.0
LONGEST_S = 40.0
# By width in metres: the share of the speed at which a competent driver passes, and the allowed ratio of
# times.
DOORS = {0.90: (0.5, 1.02), 0.80: (0.5, 1.02), 0.70: (0.4, 1.03), 0.64: (0.3, 1.10)}
WIDE_M = 0.70  # in a door of at least this width nobody may be stuck, whatever conditions are drawn
RATES_HZ = (5.0, 10.0, 15.0, 30.0)  # of depth pictures


class Passage(NamedTuple):
    """The arguments of one case."""

    controller: str
    width_m: float
    seed: int
    size: tuple[int, int] = STANDARD.depth_size  # of depth pictures
    drawn: bool = False  # sensors, delays, brakes, slip and drift, by the seed


class Outcome(NamedTuple):
    """Result of one run: seconds of the course, or the reason for no result."""

    touched: bool
    arrived: bool
    time_s: float


def measure(repeats: int) -> list[Figure]:
    """Return the time with the gate divided by the time without, and how many did not get through.

    Only the courses count that are driven without contact when there is no gate.
    """
    seeds = range(max(repeats, 3))
    jobs = [Passage("none", width, seed) for width in DOORS for seed in seeds]
    jobs += [Passage("gate", width, seed, size) for width in DOORS for size in DEPTH_SIZES for seed in seeds]
    jobs += [
        Passage(name, width, seed, drawn=True)
        for width in DOORS
        for name in ("none", "gate")
        for seed in seeds
    ]
    done = dict(played("doors", jobs, play))
    figures = []
    for width in DOORS:
        driven = [seed for seed in seeds if _good(done[Passage("none", width, seed)])]
        alone_s = sum(done[Passage("none", width, seed)].time_s for seed in driven)
        by_size = {
            size: [done[Passage("gate", width, seed, size)] for seed in driven] for size in DEPTH_SIZES
        }
        figures += _figures(width, by_size, alone_s)
        figures += _drawn_figures(width, done)
    return figures


def _drawn_figures(width: float, done: dict[Passage, Outcome]) -> list[Figure]:
    """Return the figures with drawn conditions, of the courses that a driver passes without gate."""
    alone = [job for job, end in done.items() if job.drawn and job[:2] == ("none", width) and _good(end)]
    ends = [done[job._replace(controller="gate")] for job in alone]
    where = f"door of {width:.2f} m, gate, drawn"
    limit = 0.0 if width >= WIDE_M else None
    through = [job for job in alone if _good(done[job._replace(controller="gate")])]
    helped_s = sum(done[job._replace(controller="gate")].time_s for job in through)
    ratio = helped_s / sum(done[job].time_s for job in through) if through else math.nan
    for job in alone:
        if not _good(done[job._replace(controller="gate")]):
            progress(
                f"python -m benchmarks.world door {width} {job.seed} --drawn --quiet  # {words_of(job.seed)}"
            )
    return [
        Figure(f"{where}: time / time without", ratio, ""),
        Figure(f"{where}: contacts of {len(ends)}", sum(end.touched for end in ends), "", 0.0),
        Figure(f"{where}: not through of {len(ends)}", len(ends) - len(through), "", limit),
    ]


def _figures(width: float, by_size: dict[tuple[int, int], list[Outcome]], alone_s: float) -> list[Figure]:
    """Return the time with each size of depth pictures, and how many did not get through, over all sizes."""
    where = f"door of {width:.2f} m, gate"
    figures = []
    for (columns, rows), ends in by_size.items():
        ratio = sum(end.time_s for end in ends) / alone_s if ends else math.nan
        sized = f"{where}, depth {columns}x{rows}"
        figures.append(Figure(f"{sized}: time / time without", ratio, "", DOORS[width][1]))
    ends = [end for some in by_size.values() for end in some]
    stuck = sum(not _good(end) for end in ends)
    return [*figures, Figure(f"{where}: not through of {len(ends)}", stuck, "", 0.0)]


def _good(outcome: Outcome) -> bool:
    return outcome.arrived and not outcome.touched


def play(passage: Passage) -> Outcome:
    case = build(passage.width_m, passage.seed, passage.size, drawn=passage.drawn)
    trace = loop_of(case, passage.controller, passage.seed).play()
    return Outcome(bool(trace.touches), trace.arrived, trace.time_s)


def build(
    width_m: float, seed: int, size: tuple[int, int] = STANDARD.depth_size, *, drawn: bool = False
) -> Case:
    """Build the case: from one side, a little off the middle, through the door.

    The seed chooses the camera's rate.
    """
    random = np.random.default_rng([seed, 33])
    share, _ = DOORS[width_m]
    half = width_m / 2.0
    walls = [
        Wall(name=f"{side} wall", start=(AT_M, sign * half), end=(AT_M, sign * 3.0), thickness=0.12)
        for side, sign in (("left", 1.0), ("right", -1.0))
    ]
    start = Pose(0.0, float(random.uniform(-0.3, 0.3)), float(random.uniform(-0.3, 0.3)))
    points = [(AT_M - 0.7, 0.0), (AT_M + 0.5, 0.0), (AT_M + 1.5, 0.0)]
    rate_hz = RATES_HZ[seed % len(RATES_HZ)]
    sized = Conditions(sensors=Sensors(depth_size=size, depth_hz=rate_hz))
    conditions = conditions_of(seed) if drawn else sized
    return Case(
        World(name="door", size=(-4.0, -4.0, 6.0, 4.0), walls=walls),
        start,
        lambda _: Follower(points, share),
        longest_s=LONGEST_S,
        at_rest_s=LONGEST_S,
        conditions=conditions,
    )
