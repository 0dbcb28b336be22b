"""A minute of adversarial stick in clutter: walls, legs, tables, chairs, boxes, people who stand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure
from benchmarks.world.drivers import Restless
from benchmarks.world.judge import Keeping, kept, together
from benchmarks.world.loop import Case
from benchmarks.world.play import at_most, loop_of, played
from benchmarks.world.truth import Truth
from robots.simulator.physics import Pose
from robots.simulator.worlds import Box, Chair, Person, Table, Wall, World

MINUTE_S = 60.0
HALF_M = 3.5
CLEAR_M = 0.9  # about where the robot begins
SHARE = 200 / 30  # minutes for each repeat
CONTROLLERS = ("gate", "cone", "monitor")


class Minute(NamedTuple):
    """Which case."""

    controller: str
    seed: int


class Outcome(NamedTuple):
    """What came of it."""

    contact: str | None  # part and thing
    way_m: float
    kept: Keeping


def measure(repeats: int) -> list[Figure]:
    """Crashes, the way driven, and what is left of the stick where the way is free. A crash ends its minute."""
    minutes = math.ceil(SHARE * repeats)
    jobs = [Minute("gate", seed) for seed in range(minutes)]
    jobs += [Minute(name, seed) for name in ("cone", "monitor") for seed in range(min(minutes, 20))]
    figures = []
    done = list(played("clutter", jobs, play))
    for name in CONTROLLERS:
        outcomes = [outcome for minute, outcome in done if minute.controller == name]
        figures += _figures(name, outcomes)
    return figures


def _figures(name: str, outcomes: list[Outcome]) -> list[Figure]:
    crashes = sum(outcome.contact is not None for outcome in outcomes)
    hundreds = sum(outcome.way_m for outcome in outcomes) / 100.0
    sums = together(outcome.kept for outcome in outcomes)
    ours = name == "gate"
    where = f"clutter, {name}"
    return [
        Figure(f"{where}: crashes in {len(outcomes)} minutes", crashes, "", 0.0 if ours else None),
        Figure(f"{where}: crashes per 100 m", crashes / hundreds, "/100m"),
        Figure(f"{where}: bound of that (95 %)", at_most(crashes) / hundreds, "/100m"),
        Figure(f"{where}: false stops", sums.false_stop_percent, "%", 2.0 if ours else None),
        Figure(f"{where}: speed lost with 2 m free", sums.lost_percent, "%", 10.0 if ours else None),
    ]


def play(minute: Minute) -> Outcome:
    """Play one."""
    loop = loop_of(build(minute.seed), minute.controller, minute.seed)
    truth = Truth(loop.robot.physics)
    trace = loop.play()
    contact = f"{trace.touches[0].part} / {trace.touches[0].other}" if trace.touches else None
    return Outcome(contact, trace.way_m, kept(trace, truth, loop.limits))


def build(seed: int) -> Case:
    """The case."""
    random = np.random.default_rng([seed, 21])
    return Case(
        _room(random),
        Pose(0.0, 0.0, float(random.uniform(0.0, math.tau))),
        Restless,
        longest_s=MINUTE_S,
        at_rest_s=math.inf,
    )


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
    """Somewhere in the room, with what reaches so far clear of where the robot begins."""
    while True:
        x, y = random.uniform(-HALF_M + 0.3, HALF_M - 0.3, 2).tolist()
        if math.hypot(x, y) > CLEAR_M + reach_m - 0.3:
            return x, y


def _degrees(random: np.random.Generator) -> float:
    return float(random.uniform(0.0, 360.0))
