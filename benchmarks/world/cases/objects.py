"""Full stick at one object, by kind of object, stick angle, speed and seed.

The stick's angle is its direction: 0 is full ahead, 45 ahead and left, 90 a turn on the spot, 180 reverse. A case
computes the path of the base with this stick position, and puts the object where the hull will meet it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure
from benchmarks.world.drivers import Approach, FullStick
from benchmarks.world.judge import Keeping, kept, together
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import at_most, loop_of, played
from benchmarks.world.truth import Truth
from benchmarks.world.witness import Contact, first_contact
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import TIAGO
from robots.simulator.worlds import Box, Chair, Person, Table, Wall, World

Random = np.random.Generator
RADIUS_M = 0.27
ANGLES = (0, 45, 90, 135, 180)
SHARES = (0.5, 1.0)
REVERSE_MPS = 0.2
TURN_RADPS = 2.0944
ROOM_M = 8.0
NEAREST_M = 0.05  # between the hull and the object, when the run begins
MOST_DRAWS = 200
ARC_TRIES_S = 5.0  # of stick on an arc: after this time the object was met or passed
PARKED_S = (0.5, 5.0)  # from the start of the sensors until a cold run's stick is pushed
# The robot comes from this far to the place where it begins to reverse. On the way its camera sees objects
# that the laser cannot see.
COMES_FROM_M = 1.0
# How far the base's disc would overlap an object beside it, if nothing stopped the robot: at the height of a
# table the robot is narrower.
OVERLAP_M = {"chair": 0.03, "desk without legs": 0.11, "table top": 0.11}


class Spot(NamedTuple):
    """Place of the robot's middle when it meets the object, and its direction there (radians)."""

    x: float
    y: float
    heading: float

    def ahead(self, distance_m: float, aside_m: float = 0.0) -> tuple[float, float]:
        """Return the point this far ahead of the spot and to its left, metres."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * distance_m - sin * aside_m, self.y + sin * distance_m + cos * aside_m


Put = Callable[[Spot, Random], World]


def _world(**things: list[object]) -> World:
    return World(name="one thing", size=(-ROOM_M, -ROOM_M, ROOM_M, ROOM_M), **things)  # type: ignore[arg-type]


def _wall(spot: Spot, random: Random) -> World:
    tilt = float(random.uniform(-0.3, 0.3))
    x, y = spot.ahead(RADIUS_M / math.cos(tilt) + 0.05)
    across = spot.heading + math.pi / 2.0 + tilt
    dx, dy = 1.5 * math.cos(across), 1.5 * math.sin(across)
    return _world(walls=[Wall(name="wall", start=(x - dx, y - dy), end=(x + dx, y + dy))])


def _person(spot: Spot, random: Random) -> World:
    aside = float(random.uniform(-0.25, 0.25))
    x, y = spot.ahead(RADIUS_M + 0.15, aside)
    toes = float(random.uniform(0.0, math.tau))
    # A person's yaw is the direction of the path. This person stands: the path only sets the yaw and is never
    # walked.
    return _world(people=[Person(name="person", at=(x, y), path=[(x + math.cos(toes), y + math.sin(toes))])])


def _leg_at(spot: Spot, aside: float, random: Random) -> World:
    at = spot.ahead(math.sqrt(max(RADIUS_M**2 - aside**2, 0.0)) + 0.02, aside)
    yaw = float(random.uniform(0.0, 90.0))
    return _world(boxes=[Box(name="leg", at=at, size=(0.04, 0.04, 0.72), yaw=yaw)])


def _leg(spot: Spot, random: Random) -> World:
    return _leg_at(spot, float(random.uniform(-0.1, 0.1)), random)


def _grazing_leg(spot: Spot, random: Random) -> World:
    side = float(random.choice((-1.0, 1.0)))
    return _leg_at(spot, side * float(random.uniform(0.20, 0.265)), random)


def _leg_on_arc(spot: Spot, random: Random) -> World:
    return _leg_at(spot, float(random.uniform(-0.2, 0.2)), random)


def _chair(spot: Spot, random: Random) -> World:
    at = spot.ahead(RADIUS_M + 0.25, float(random.uniform(-0.15, 0.15)))
    return _world(chairs=[Chair(name="chair", at=at, yaw=float(random.uniform(0.0, 360.0)))])


def _desk(spot: Spot, random: Random) -> World:
    at = spot.ahead(RADIUS_M + 0.35, float(random.uniform(-0.3, 0.3)))
    yaw = math.degrees(spot.heading) + float(random.uniform(-15.0, 15.0))
    return _world(tables=[Table(name="desk", at=at, size=(0.7, 1.4), yaw=yaw, legs=False)])


def _table(spot: Spot, random: Random) -> World:
    """Put the spot between the table's legs: only the top is in the way."""
    at = spot.ahead(RADIUS_M + 0.4, float(random.uniform(-0.3, 0.3)))
    yaw = math.degrees(spot.heading) + float(random.uniform(-10.0, 10.0))
    return _world(tables=[Table(name="table", at=at, size=(0.8, 1.8), yaw=yaw)])


OBJECTS: dict[str, Put] = {
    "wall": _wall,
    "person": _person,
    "table leg": _leg,
    "grazing leg": _grazing_leg,
    "leg on an arc": _leg_on_arc,
    "chair": _chair,
    "desk without legs": _desk,
    "table top": _table,
}
UNSEEN = {"desk without legs", "table top"}  # by the laser
ABOVE_LASER = UNSEEN | {"chair"}  # the laser does not see these, or sees only a part


class ObjectJob(NamedTuple):
    """One case: controller, object, stick angle in degrees, share of the robot's speed, seed."""

    controller: str
    thing: str
    angle: int
    share: float
    seed: int
    blanked: bool = False
    cold: bool = False  # the robot was parked there: it has not moved or looked around before
    pulls_again: bool = True  # the driver lets go after a refused reverse, and pulls back again


class Outcome(NamedTuple):
    """Result of one run."""

    touched: Contact | None
    final_gap_m: float
    kept: Keeping


def measure(repeats: int) -> list[Figure]:
    """Return crashes by object with the gate and without, with bounds, and how much of the asked speed is left."""
    jobs = [*cases("gate", repeats), *cases("gate", repeats, blanked=True), *cases("none", min(repeats, 2))]
    done = list(played("objects", jobs, play))
    figures = []
    for name, blanked in (("gate", False), ("gate", True), ("none", False)):
        mine = [(job, end) for job, end in done if (job.controller, job.blanked) == (name, blanked)]
        figures += _figures(f"{name}, blanked" if blanked else name, mine, ours=name == "gate")
    return figures


def _figures(name: str, done: list[tuple[ObjectJob, Outcome]], *, ours: bool) -> list[Figure]:
    figures = []
    for thing in OBJECTS:
        ends = [end for job, end in done if job.thing == thing and job.angle != 90]
        crashes = sum(end.touched is not None for end in ends)
        if not ends:
            continue
        figures.append(Figure(f"{thing}, {name}: crashes of {len(ends)}", crashes, "", 0.0 if ours else None))
    spot = [end.touched is not None for job, end in done if job.angle == 90]
    figures.append(
        Figure(f"turning on the spot, {name}: crashes of {len(spot)}", sum(spot), "", 0.0 if ours else None)
    )
    crashes = sum(end.touched is not None for _, end in done)
    percent = min(100.0 * at_most(crashes) / len(done), 100.0)
    figures.append(Figure(f"all, {name}: crashes, at most (95 %, of {len(done)})", percent, "%"))
    if not ours:
        return figures
    gap = max(
        (end.final_gap_m for job, end in done if job.thing == "wall" and job.angle in (0, 180)), default=0.0
    )
    sums = together(end.kept for _, end in done)
    return [
        *figures,
        Figure(f"wall, {name}: widest gap in the end", gap, "m", 0.20),
        Figure(f"all, {name}: speed lost with 2 m free", sums.lost_percent, "%", 10.0),
        Figure(f"all, {name}: false stops", sums.false_stop_percent, "%", 1.0),
        Figure(f"all, {name}: stuck, of the time", sums.stuck_percent, "%", 0.5),
    ]


def play(job: ObjectJob) -> Outcome:
    case = replace(build(job), pulls_again=job.pulls_again)
    return outcome(case, job.controller, job.seed)


def outcome(case: Case, controller: str, seed: int) -> Outcome:
    """Play a case that has one object, and return its outcome."""
    loop = loop_of(case, controller, seed)
    truth = Truth(loop.robot.physics)
    trace = loop.play()
    return Outcome(first_contact(loop), trace.moments[-1].gap_m, kept(trace, truth, loop.limits))


def cases(controller: str, seeds: int, blanked: bool = False) -> list[ObjectJob]:
    """Return all cases. In reverse both shares mean the robot's own limit, so they are one case.

    For objects that the laser cannot see, a blanked scan makes no difference.
    """
    things = OBJECTS.keys() - UNSEEN if blanked else OBJECTS
    return [
        ObjectJob(controller, thing, angle, share, seed, blanked)
        for thing, angle, share in itertools.product(things, ANGLES, SHARES)
        if not (angle in (90, 180) and share < 1.0)
        for seed in range(seeds)
    ]


def build(job: ObjectJob) -> Case:
    """Build the case. An object that would begin nearer than `NEAREST_M` is drawn again."""
    random = np.random.default_rng([job.seed, job.angle, list(OBJECTS).index(job.thing)])
    for _ in range(MOST_DRAWS):
        case = _drawn(job, random)
        if Physics(case.world, TIAGO, case.start).clearance_m() >= NEAREST_M:
            return case
    raise RuntimeError(f"no room for {job}")


def _drawn(job: ObjectJob, random: Random) -> Case:
    x, w = _stick(job, random)
    spot = _spot(x, w, job, random)
    conditions = Conditions(blanked=job.blanked)
    turns_to_it = not job.cold and (job.angle >= 135 or (job.angle == 45 and job.thing in ABOVE_LASER))
    world = OBJECTS[job.thing](spot, random)
    tries_s = ARC_TRIES_S if w else math.inf
    if not turns_to_it:
        ahead = Pose(0.0, 0.0, 0.0)
        parked_s = float(random.uniform(*PARKED_S)) if job.cold else 0.0
        driver = FullStick(x, w, job.share, parked_s)
        return Case(world, ahead, lambda _: driver, 10.0 + parked_s, 1.0, tries_s, conditions)
    at = spot.ahead(RADIUS_M)
    facing = math.atan2(at[1], at[0])
    back_m = COMES_FROM_M if job.thing in ABOVE_LASER else 0.0
    start = Pose(-back_m * math.cos(facing), -back_m * math.sin(facing), facing)
    return Case(world, start, lambda _: Approach(x, w, job.share), 20.0, 1.0, tries_s, conditions)


def _stick(job: ObjectJob, random: Random) -> tuple[float, float]:
    """Return the stick's position: x, w."""
    if job.angle == 90:
        return 0.0, 1.0
    angle = math.radians(job.angle)
    if job.thing == "leg on an arc":
        angle += float(random.choice((-1.0, 1.0)) * random.uniform(0.14, 0.35))
    return math.cos(angle), round(math.sin(angle), 9)


def _spot(x: float, w: float, job: ObjectJob, random: Random) -> Spot:
    """Draw a spot on the way of a stick at (x, w), from the origin with heading 0."""
    if x == 0.0:  # the disc turns on the spot; the object stands next to it
        heading = float(random.uniform(-math.pi, math.pi) if job.cold else random.uniform(-1.6, 1.6))
        gap = float(random.uniform(NEAREST_M, 0.10))
        return Spot(gap * math.cos(heading), gap * math.sin(heading), heading)
    speed = x * job.share if x > 0.0 else x * min(job.share, REVERSE_MPS)
    turn = w * TURN_RADPS * job.share
    if abs(turn) < 1e-6:
        far = float(random.uniform(1.6, 3.0)) if speed > 0.0 else -float(random.uniform(0.4, 0.9))
        return Spot(far, 0.0, 0.0 if speed > 0.0 else math.pi)
    radius = speed / turn  # of the arc, positive to the left
    if job.thing in ABOVE_LASER and speed < 0.0 and not job.cold:
        return _outwards(radius, OVERLAP_M[job.thing], math.copysign(float(random.uniform(2.4, 3.1)), turn))
    turned = math.copysign(_turned(abs(radius), random), turn)
    heading = turned if speed > 0.0 else turned + math.pi
    return Spot(radius * math.sin(turned), radius * (1.0 - math.cos(turned)), heading)


def _outwards(radius_m: float, overlap_m: float, turned: float) -> Spot:
    """Return a spot next to a tight arc, where the hull is farthest from its start.

    The robot could see an object there before.
    """
    sin, cos = math.sin(turned), math.cos(turned)
    inwards_m = abs(radius_m) - overlap_m
    out = math.copysign(1.0, radius_m)
    heading = math.atan2(-cos * out, sin * out)
    return Spot(inwards_m * math.cos(heading), radius_m + inwards_m * math.sin(heading), heading)


def _turned(radius_m: float, random: Random) -> float:
    """Draw the angle on the arc at which the robot meets the object, radians.

    On a tight arc the angle is large, so that the arc does not begin at the object.
    """
    if radius_m > 1.0:
        return float(random.uniform(1.2, 2.2)) / radius_m
    return float(random.uniform(1.3, 1.9))
