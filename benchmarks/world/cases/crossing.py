"""A person walks across the way without looking; the stick is held fully ahead."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure
from benchmarks.world.drivers import FullStick
from benchmarks.world.loop import WARM_UP_S, Case
from benchmarks.world.play import loop_of, played
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Person, World

SHARES = (0.5, 1.0)
MOVING_MPS = 0.03
HULL_M = 0.27
MOVING_PERCENT = 10.0


class Crossing(NamedTuple):
    """The arguments of one case."""

    controller: str
    share: float
    seed: int


def measure(repeats: int) -> list[Figure]:
    """Count ends with the gate: contact while the robot moves, contact at rest, no contact.

    Only the cases count in which a moving robot without gate has a contact.
    """
    names = ("none", "gate")
    jobs = [Crossing(name, share, seed) for name in names for share in SHARES for seed in range(2 * repeats)]
    done = dict(played("crossing", jobs, play))
    provoked = [job for job in jobs if job.controller == "none" and done[job] == "moving"]
    ends = [done[job._replace(controller="gate")] for job in provoked]
    figures = []
    for end in ("moving", "at rest", "none"):
        percent = 100.0 * ends.count(end) / len(ends) if ends else math.nan
        limit = MOVING_PERCENT if end == "moving" else None
        figures.append(Figure(f"crossing, gate: contact {end}, of {len(ends)}", percent, "%", limit))
    return figures


def play(crossing: Crossing) -> str:
    """Play one case. Return how it ends: "moving", "at rest" or "none"."""
    loop = loop_of(build(crossing.share, crossing.seed), crossing.controller, crossing.seed)
    trace = loop.play()
    if not trace.touches:
        return "none"
    robot = trace.touches[0].robot
    return "moving" if math.hypot(robot.vx, robot.vy) > MOVING_MPS else "at rest"


def build(share: float, seed: int) -> Case:
    """Build the case: the person reaches the robot's way when a robot that nothing slows would be there."""
    random = np.random.default_rng([seed, 45])
    way_m = float(random.uniform(1.5, 3.0))
    meets_s = WARM_UP_S + way_m / share + share / 2.0  # it accelerates with 1 m/s^2
    speed = float(random.uniform(0.6, 1.4))
    side = float(random.choice((-1.0, 1.0)))
    slant = float(random.uniform(-0.6, 0.6))
    at = (way_m + HULL_M * float(random.uniform(-0.6, 0.8)), 0.0)
    dx, dy = math.sin(slant), side * math.cos(slant)
    far_m = min(speed * meets_s, 4.0)
    begins = (at[0] + dx * far_m, at[1] + dy * far_m)
    ends = (at[0] - 3.0 * dx, at[1] - 3.0 * dy)
    person = Person(name="person", at=begins, path=[begins, ends], speed_mps=speed)
    return Case(
        World(name="crossing", size=(-8.0, -8.0, 8.0, 8.0), people=[person]),
        Pose(0.0, 0.0, 0.0),
        lambda _: FullStick(1.0, 0.0, share),
        longest_s=meets_s + 2.5,
        at_rest_s=math.inf,
        person_starts_s=meets_s - far_m / speed,
    )
