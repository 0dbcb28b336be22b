"""Minutes of adversarial stick in clutter: walls, legs, tables, chairs, standing people. Half is in reverse.

Every second minute begins cold: without a look around. FLEET_BENCH_METRES are driven with the gate, and a
quarter of this distance again with drawn sensors, delays, brakes, slip and drift.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.cases.drawn import conditions_of
from benchmarks.world.drivers import Restless
from benchmarks.world.judge import Keeping, kept, together
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import at_most, loop_of, played
from benchmarks.world.truth import Truth
from benchmarks.world.witness import Contact, count, first_contact, worst_first
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Box, Chair, Person, Table, Wall, World

MINUTE_S = 60.0
HALF_M = 3.5
CLEAR_M = 0.9  # radius without objects around the robot's start
METRES = float(os.environ.get("FLEET_BENCH_METRES", "100"))  # 10000: some two hours on two cores
DRAWN_SHARE = 0.25  # of the metres, driven again with drawn conditions
A_MINUTE_M = 7.0  # about the way of one minute
WORST = 10
AT_MOST, ENOUGH_M = 0.05, 6000.0  # crashes per 100 m, and the metres needed to show such a low rate


class Minute(NamedTuple):
    """The arguments of one case."""

    seed: int
    drawn: bool = False  # sensors, delays, brakes, slip and drift, by the seed


class Outcome(NamedTuple):
    """Result of one run."""

    contact: Contact | None
    way_m: float
    reverse_m: float  # part of the way
    kept: Keeping


def measure(_repeats: int) -> list[Figure]:
    """Return crashes, the way driven, and how much of the asked speed is left where the way is free.

    A crash ends its minute.
    """
    drawn = _figures("gate, drawn", _driven_far(DRAWN_SHARE * METRES, drawn=True))
    return [*_figures("gate", _driven_far(METRES)), *drawn]


def _driven_far(metres: float, *, drawn: bool = False) -> list[tuple[Minute, Outcome]]:
    """Play minutes until these metres are driven. Return each minute with its outcome.

    If the robot hardly moves, the way is shorter.
    """
    done: list[tuple[Minute, Outcome]] = []
    while (left_m := metres - sum(outcome.way_m for _, outcome in done)) > 0.0 and len(done) <= metres:
        first, more = len(done), math.ceil(left_m / A_MINUTE_M)
        jobs = [Minute(seed, drawn) for seed in range(first, first + more)]
        done += played(f"clutter, {left_m:.0f} m to go", jobs, play)
    return done


def _figures(name: str, done: list[tuple[Minute, Outcome]]) -> list[Figure]:
    outcomes = [outcome for _, outcome in done]
    met = count(outcome.contact for outcome in outcomes)
    way_m = sum(outcome.way_m for outcome in outcomes)
    reverse_m = sum(outcome.reverse_m for outcome in outcomes)
    sums = together(outcome.kept for outcome in outcomes)
    where = f"clutter, {name}"
    limit = AT_MOST if way_m >= ENOUGH_M else None
    bound = _bound(met.known, way_m)
    _name_worst(done)
    _name_causes("stuck", sums.stuck_by)
    _name_causes("false stops", sums.stopped_by)
    return [
        Figure(f"{where}: way in {len(outcomes)} minutes", way_m, "m"),
        Figure(f"{where}: of it in reverse", 100.0 * reverse_m / way_m if way_m else math.nan, "%"),
        Figure(f"{where}: contacts with what was seen or heard", met.known, "", 0.0),
        Figure(f"{where}: contacts with what was seen too late", met.late, ""),
        Figure(f"{where}: contacts with what no sensor can have seen", met.unseen, ""),
        Figure(f"{where}: contacts with what was seen, bound (95 %)", bound, "/100m", limit),
        Figure(f"{where}: stuck, of the time", sums.stuck_percent, "%", 0.5),
        Figure(f"{where}: false stops", sums.false_stop_percent, "%", 1.0),
        # The gate limits reverse to 0.1 m/s
        Figure(f"{where}: speed lost with 2 m free", sums.lost_percent, "%"),
        Figure(f"{where}: speed lost with 2 m free ahead", sums.lost_ahead_percent, "%", 10.0),
        Figure(f"{where}: of 0.1 m/s lost with 2 m free behind", sums.lost_back_percent, "%", 10.0),
    ]


def _bound(contacts: int, way_m: float) -> float:
    return 100.0 * at_most(contacts) / way_m if way_m else math.nan


def _name_worst(done: list[tuple[Minute, Outcome]]) -> None:
    """Print the worst minutes that ended in contact, with the commands that play them again."""
    met = [(outcome.contact, minute) for minute, outcome in done if outcome.contact]
    for contact, minute in sorted(met, key=lambda pair: worst_first(pair[0]))[:WORST]:
        drawn = " --drawn" if minute.drawn else ""
        progress(f"python -m benchmarks.world clutter {minute.seed}{drawn} --quiet  # {contact}")


def _name_causes(title: str, causes: Counter[str]) -> None:
    """Print what held the robot, the most frequent cause first."""
    for cause, times in causes.most_common(WORST):
        progress(f"{title}: {100.0 * times / causes.total():3.0f} % {cause}")


def play(minute: Minute) -> Outcome:
    loop = loop_of(build(minute.seed, drawn=minute.drawn), "gate", minute.seed)
    truth = Truth(loop.robot.physics)
    trace = loop.play()
    keeping = kept(trace, truth, loop.limits)
    return Outcome(first_contact(loop), trace.way_m, trace.reverse_m, keeping)


def build(seed: int, *, drawn: bool = False) -> Case:
    random = np.random.default_rng([seed, 21])
    return Case(
        _room(random),
        Pose(0.0, 0.0, float(random.uniform(0.0, math.tau))),
        _driver(seed),
        longest_s=MINUTE_S,
        at_rest_s=math.inf,
        conditions=conditions_of(seed) if drawn else Conditions(),
    )


def _driver(seed: int) -> Callable[[np.random.Generator], Restless]:
    """Return the driver of a seed: with even seeds it looks around first."""
    return lambda random: Restless(random, looks=seed % 2 == 0)


def _room(random: np.random.Generator) -> World:
    corners = [(-HALF_M, -HALF_M), (HALF_M, -HALF_M), (HALF_M, HALF_M), (-HALF_M, HALF_M)]
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    boxes = [
        Box(name=f"leg {n}", at=_place(random), size=(0.04, 0.04, 0.7), yaw=_degrees(random))
        for n in range(5)
    ]
    boxes += [
        Box(name=f"box {n}", at=_place(random), size=(0.4, 0.3, 0.4), yaw=_degrees(random)) for n in range(2)
    ]
    return World(
        name="clutter",
        size=(-9.0, -9.0, 9.0, 9.0),
        walls=[Wall(name=f"wall {n}", start=start, end=end) for n, (start, end) in enumerate(sides)],
        boxes=boxes,
        chairs=[Chair(name=f"chair {n}", at=_place(random), yaw=_degrees(random)) for n in range(3)],
        tables=[
            Table(name="table", at=_place(random, 1.0), size=(1.4, 0.8), yaw=_degrees(random)),
            Table(name="desk", at=_place(random, 0.8), size=(0.7, 1.2), yaw=_degrees(random), legs=False),
        ],
        people=[Person(name="person", at=_place(random))],
    )


def _place(random: np.random.Generator, reach_m: float = 0.3) -> tuple[float, float]:
    """Draw a place in the room for an object of this radius, clear of the robot's start."""
    while True:
        x, y = random.uniform(-HALF_M + 0.3, HALF_M - 0.3, 2).tolist()
        if math.hypot(x, y) > CLEAR_M + reach_m - 0.3:
            return x, y


def _degrees(random: np.random.Generator) -> float:
    return float(random.uniform(0.0, 360.0))
