"""An obstacle leaves while the stick is held: seconds until the robot may drive again.

The time counts from the moment when no object is nearer to the hull than 0.5 m. Runs in which the robot was not held,
or touched an object before, do not count.

Behind the robot no sensor looks as high as laser and camera did before. And if a leg leaves a sonar's cone at
the rim, the sonar does not measure it any more, although the leg still stands there. So there is no time
limit for seen objects behind the robot, and with objects that were only heard some runs exceed the limit.
Away from the object the robot must drive at once: the same cases are played with a stick that goes ahead in
the end. They are also played with a driver that turns around before, and then drives to the place.

In `GLANCED` the head is turned aside before the object goes, so that no sensor sees the whole place. Later
somebody presses *Look ahead*: the time counts from this moment.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress, quantile
from benchmarks.world.cases import crossing, objects
from benchmarks.world.loop import RELEASED, Case, Driver, Glance, Leaving, Seen, Stick, Trace
from benchmarks.world.play import loop_of, played
from robots.shared.geometry.planar import wrapped
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Chair, Person, Table

GONE_M = 0.5  # from the hull
PATIENCE_S = 20.0  # after the object began to go
AWAY_M = 3.0
AGAIN_S = 1.0
DRIVES_MPS = 0.1  # at this speed, or at `DRIVES_SHARE` of the asked speed, the robot drives
DRIVES_SHARE = 0.3
TURNING, AWAY = Stick(0.0, 1.0, 0.5, trying=False), Stick(1.0, 0.0, 0.5, trying=False)
# The robot turns around this far from the place: there the whole place is in the camera's picture
OFF_M = 0.5
AROUND_RAD = 0.3  # the turn ends this much before half a turn, because the base turns on by about as much
HELD_S = 3.0  # from the departure of the object behind the robot until the stick rests
RESTS_S = 0.5  # rest of the stick, before it goes ahead


class Kind(NamedTuple):
    """A leaving obstacle: kind, direction and time of departure, and whether the robot was parked there."""

    thing: str
    angle: int
    since_s: float
    cold: bool


KINDS = {
    "person who stood ahead": Kind("person", 0, 8.0, cold=True),
    "chair pulled away ahead": Kind("chair", 0, 8.0, cold=True),
    "person who came up behind": Kind("person", 180, 12.0, cold=True),
    "chair pulled away behind": Kind("chair", 180, 12.0, cold=True),
    "person who was passed, behind": Kind("person", 180, 20.0, cold=False),
    "chair seen before, behind": Kind("chair", 180, 20.0, cold=False),
}
CROSSED = "person who crossed"
GLANCED = {
    "chair pulled away, head aside": Kind("chair", 0, 8.0, cold=True),
    "desk pulled away, head aside": Kind("desk without legs", 0, 8.0, cold=True),
    "table pulled away, head aside": Kind("table top", 0, 8.0, cold=True),
}
THERE_M = 0.2
AROUND_S = 10.0  # of these, half a metre away, half a turn and 0.7 m back take 6 s
LOOK_AHEAD_S = 5.0  # the robot must drive again within this time after *Look ahead*
ASIDE_RAD = 1.2
ASIDE_S, PRESSED_S = 2.0, 8.0  # head aside before the object begins to go; *Look ahead* after it


class LeavingJob(NamedTuple):
    """The arguments of one case."""

    kind: str
    seed: int
    ahead: bool = False  # in the end the stick goes ahead
    turns: bool = False  # before, the robot turns around, to see the place and drive there


class Ahead:
    """Holds the stick like another driver until `from_s`, then rests, then goes ahead."""

    def __init__(self, first: Driver, from_s: float, share: float) -> None:
        self._first = first
        self._from_s = from_s
        self._ahead = Stick(1.0, 0.0, share)

    def hold(self, seen: Seen) -> Stick | None:
        if seen.time_s < self._from_s:
            return self._first.hold(seen)
        return RELEASED if seen.time_s < self._from_s + RESTS_S else self._ahead


class Around(Ahead):
    """Drives a little away and turns around before it goes ahead: so it drives to where it was held."""

    def __init__(self, first: Driver, from_s: float, share: float) -> None:
        super().__init__(first, from_s, share)
        self._stood: Pose | None = None  # pose before it drives away
        self._turns = True

    def hold(self, seen: Seen) -> Stick | None:
        if seen.time_s < self._from_s + RESTS_S:
            return super().hold(seen)
        self._stood = self._stood or seen.pose
        left_rad = math.pi - abs(wrapped(seen.pose.yaw - self._stood.yaw))
        if math.hypot(seen.pose.x - self._stood.x, seen.pose.y - self._stood.y) < OFF_M and self._turns:
            return AWAY
        if self._turns and left_rad > AROUND_RAD:
            return TURNING
        self._turns = False
        return super().hold(seen)


class Outcome(NamedTuple):
    """Seconds until the robot drives again, and what held it.

    Infinite: it does not; None: the run does not count.
    """

    again_s: float | None
    held_by: str = ""


def measure(repeats: int) -> list[Figure]:
    """Return the longest and the median time by kind, and how many robots did not drive again."""
    seeds = 3 * repeats
    jobs = [LeavingJob(kind, seed) for kind in (CROSSED, *KINDS, *GLANCED) for seed in range(seeds)]
    done = list(played("leaving", jobs, play))
    figures = []
    for kind in (CROSSED, *KINDS, *GLANCED):
        mine = [(job, end) for job, end in done if job.kind == kind and end.again_s is not None]
        again_s = [end.again_s for _, end in mine if end.again_s is not None]
        limited = kind == CROSSED or (KINDS | GLANCED)[kind].cold
        what, most_s = ("Look ahead", LOOK_AHEAD_S) if kind in GLANCED else ("gone", AGAIN_S)
        came_s = [min(seconds, PATIENCE_S) for seconds in again_s]
        figures += [
            Figure(f"{kind}, {what}: longest until it drives again, of {len(mine)}", max(came_s, default=math.nan), "s",
                most_s if mine and limited else None),
            Figure(f"{kind}, {what}: p50 until it drives again", quantile(came_s, 0.5), "s"),
            Figure(f"{kind}, {what}: not within {PATIENCE_S:.0f} s", again_s.count(math.inf), "",
                0.0 if limited else None),
        ]  # fmt: skip
        _name_worst(mine)
    behind = [
        LeavingJob(kind, seed, ahead=True)
        for kind in KINDS
        for seed in range(seeds)
        if KINDS[kind].angle == 180
    ]
    ends = [(job, end) for job, end in played("away", behind, play) if end.again_s is not None]
    slowest_s = max((end.again_s or 0.0 for _, end in ends), default=math.nan)
    _name_worst(ends)
    return [
        *figures,
        Figure(f"away from what stood behind, of {len(ends)}: longest until it drives", slowest_s, "s",
            AGAIN_S if ends else None),
        *_turned_to(seeds),
    ]  # fmt: skip


def _turned_to(seeds: int) -> list[Figure]:
    """Return the longest time until the robot drives to the place of an object behind it that was only heard.

    The robot first turns around and looks.
    """
    figures = []
    for kind in (kind for kind, about in KINDS.items() if about.angle == 180 and about.cold):
        jobs = [LeavingJob(kind, seed, turns=True) for seed in range(seeds)]
        ends = [(job, end) for job, end in played("turned", jobs, play) if end.again_s is not None]
        longest_s = max((min(end.again_s or 0.0, PATIENCE_S) for _, end in ends), default=math.nan)
        figures.append(
            Figure(f"{kind}, turn around and look: longest until it drives there, of {len(ends)}", longest_s, "s",
                AROUND_S if ends else None)
        )  # fmt: skip
        _name_worst(ends)
    return figures


def _name_worst(done: list[tuple[LeavingJob, Outcome]]) -> None:
    job, end = max(done, key=lambda pair: pair[1].again_s or 0.0, default=(None, Outcome(0.0)))
    if job is not None and (end.again_s or 0.0) > AGAIN_S:
        more = f"{' --ahead' if job.ahead else ''}{' --turns' if job.turns else ''}"
        progress(
            f'python -m benchmarks.world leaving "{job.kind}" {job.seed}{more}'
            f"  # {end.again_s:.1f} s, {end.held_by}"
        )


def play(job: LeavingJob) -> Outcome:
    """Play one case."""
    case = build(job.kind, job.seed, ahead=job.ahead, turns=job.turns)
    trace = loop_of(case, "gate", job.seed).play()
    since_s = case.glance.ahead_s if case.glance else case.leaving.since_s if case.leaving else 0.0
    since_s += HELD_S + RESTS_S if job.ahead or job.turns else 0.0
    return until_there(trace, since_s) if job.turns else until_again(trace, since_s)


def until_there(trace: Trace, since_s: float) -> Outcome:
    """Return the time from `since_s` until the robot has driven `THERE_M` to the place that was behind it."""
    stood: Pose | None = None
    text = ""
    for moment in trace.moments:
        if moment.time_s < since_s:
            continue
        stood = stood or moment.pose
        dx, dy = moment.pose.x - stood.x, moment.pose.y - stood.y
        if dx * math.cos(stood.yaw) + dy * math.sin(stood.yaw) < -THERE_M:
            return Outcome(None if trace.touches else moment.time_s - since_s, text)
        text = moment.text if moment.trying else text
    return Outcome(None if trace.touches else math.inf, text)


def until_again(trace: Trace, since_s: float) -> Outcome:
    """Return how long the robot was held after the way was free. `since_s`: when the obstacle began to go."""
    if trace.touches:
        return Outcome(None)
    gone_s, was_held = math.inf, False
    held_by = ""
    for moment in trace.moments:
        if not moment.trying:
            continue
        drives = abs(moment.sent.vx) >= min(DRIVES_MPS, DRIVES_SHARE * abs(moment.asked.vx))
        near = moment.gap_m < GONE_M
        if near:
            was_held = was_held or not drives
            gone_s = math.inf
        elif was_held and moment.time_s >= since_s:
            gone_s = min(gone_s, moment.time_s)
            if drives:
                return Outcome(moment.time_s - gone_s, held_by)
            held_by = moment.text
    if not was_held:
        return Outcome(None)
    return Outcome(math.inf, held_by) if gone_s < math.inf else Outcome(None)


def build(kind: str, seed: int, *, ahead: bool = False, turns: bool = False) -> Case:
    """Build the case. The obstacle leaves sideways, or straight away from the robot."""
    if kind == CROSSED:
        case = crossing.build(objects.SHARES[seed % 2], seed)
        return replace(case, longest_s=case.longest_s + PATIENCE_S - 2.5)
    thing, angle, since_s, cold = (KINDS | GLANCED)[kind]
    case = objects.build(objects.ObjectJob("gate", thing, angle, objects.SHARES[seed % 2], seed, cold=cold))
    random = np.random.default_rng([seed, 57])
    things: list[Person | Chair | Table] = [*case.world.people, *case.world.chairs, *case.world.tables]
    one = things[0]
    aside = float(random.choice((-1.0, 0.0, 1.0))) * math.pi / 2.0 + float(random.uniform(-0.2, 0.2))
    heading = wrapped((0.0 if angle == 0 else math.pi) + aside)
    way = (AWAY_M * math.cos(heading), AWAY_M * math.sin(heading))
    if ahead or turns:
        first, share, kind_of = case.driver, objects.SHARES[seed % 2], Around if turns else Ahead
        case = replace(case, driver=lambda random: kind_of(first(random), since_s + HELD_S, share))
    leaving = Leaving(one.name, since_s, one.at, way, float(random.uniform(0.6, 1.2)))
    pan = math.copysign(ASIDE_RAD, float(random.uniform(-1.0, 1.0)))
    glance = Glance(since_s - ASIDE_S, pan, since_s + PRESSED_S) if kind in GLANCED else None
    longest_s = (glance.ahead_s if glance else since_s) + PATIENCE_S
    return replace(
        case, leaving=leaving, glance=glance, longest_s=longest_s, at_rest_s=math.inf, tries_s=math.inf
    )
