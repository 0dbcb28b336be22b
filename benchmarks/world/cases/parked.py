"""A robot that was parked close to an object turns to it, or nearly, and drives off.

Like an Xtion, the camera sees nothing within half a metre: no sensor sees the edge of a table without legs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.cases import objects
from benchmarks.world.drivers import TurnAndGo
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import loop_of, played
from benchmarks.world.sensors import Sensors
from benchmarks.world.witness import Contact, count, first_contact, worst_first
from robots.shared.geometry.planar import wrapped
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import TIAGO

GAPS_M = (0.04, 0.10)  # between hull and object
BLIND_M = 0.5
OFF_RAD = 0.4  # largest angle between the robot's way and the direction to the object
WORST = 3


class Parked(NamedTuple):
    """The arguments of one case."""

    thing: str
    seed: int


def measure(repeats: int) -> list[Figure]:
    """Return contacts by how the object was seen before, and the fastest contact."""
    jobs = [Parked(thing, seed) for thing in objects.OBJECTS for seed in range(2 * repeats)]
    done = list(played("parked", jobs, play))
    met = [(contact, parked) for parked, contact in done if contact]
    for contact, parked in sorted(met, key=lambda pair: worst_first(pair[0]))[:WORST]:
        progress(f'python -m benchmarks.world parked "{parked.thing}" {parked.seed} --quiet  # {contact}')
    known, late, unseen = count(contact for _, contact in done)
    fastest = max((contact.mps for contact, _ in met), default=0.0)
    return [
        Figure(f"parked close: contacts with what was seen or heard, of {len(done)}", known, "", 0.0),
        Figure("parked close: contacts with what was seen too late", late, ""),
        Figure("parked close: contacts with what no sensor can have seen", unseen, ""),
        Figure("parked close: fastest contact", fastest, "m/s"),
    ]


def play(parked: Parked) -> Contact | None:
    """Play one case."""
    loop = loop_of(build(parked.thing, parked.seed), "gate", parked.seed)
    loop.play()
    return first_contact(loop)


def build(thing: str, seed: int) -> Case:
    """Build the case. An object that would be too near at the start is drawn again."""
    random = np.random.default_rng([seed, 71, list(objects.OBJECTS).index(thing)])
    start = Pose(0.0, 0.0, 0.0)
    for _ in range(objects.MOST_DRAWS):
        heading, gap_m = float(random.uniform(-math.pi, math.pi)), float(random.uniform(*GAPS_M))
        spot = objects.Spot(gap_m * math.cos(heading), gap_m * math.sin(heading), heading)
        world = objects.OBJECTS[thing](spot, random)
        if Physics(world, TIAGO, start).clearance_m() >= GAPS_M[0]:
            break
    else:
        raise RuntimeError(f"no room for {thing} {seed}")
    towards = wrapped(heading + float(random.uniform(-OFF_RAD, OFF_RAD)))
    share = objects.SHARES[seed % 2]
    conditions = Conditions(sensors=Sensors(depth_nearest_m=BLIND_M))
    return Case(world, start, lambda _: TurnAndGo(towards, share), 14.0, 1.0, 4.0, conditions)
