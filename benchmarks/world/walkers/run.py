"""Play a plan: the gate, a base with limits and delays, a laser that turns while it measures, drifting odometry."""

from __future__ import annotations

import heapq
import itertools
import math
import time
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from benchmarks.world.controllers import Controller, Fan, Ranges
from benchmarks.world.walkers import plane
from benchmarks.world.walkers.plan import HULL_M, LASER, WARM_UP_S, Plan
from benchmarks.world.walkers.plane import Floats, Things
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.simulator.physics.base import BaseController, Twist
from robots.simulator.sensors.odometry import Odometry

Done = TypeVar("Done")
STARTS_S = 1000.0  # the console's clock when a run begins
ROBOT_CLOCK_S = 1.7e9
TICK_S = 0.01
ODOMETRY_TICKS = 2
PERIOD_S = 0.05  # of decisions
JITTER_S = 0.01
GHOSTS = 0.0005  # share of beams that measure what is not there
NEAREST_M, FARTHEST_M = 0.05, 25.0
SEEN_M, SEEN_BEAMS = 6.0, 3  # a person counts as seen from this many beams on, within this distance
LOST_S = 1.0  # somebody who was out of sight for longer may be anywhere
NEAR_M = 2.0  # of a trunk: a farther person's shins touch nothing
# This long after the meeting and this far away, nobody meets the robot any more
PASSED_S, PASSED_M = 0.5, 1.5
EDGE_M = 0.2  # neighbouring beams that differ by more are at an edge


class Met(NamedTuple):
    """A contact: what was touched, at which speed of the robot (m/s), where, since when it was seen."""

    time_s: float
    part: str
    mps: float
    bearing: float  # of the person, from the laser
    seen_s: float  # how long before the contact the last sight of them began; 0: nobody was seen in the last second
    seen_mps: float  # the robot's speed then


class Moment(NamedTuple):
    """One decision."""

    time_s: float
    pose: Pose
    mps: float
    sent: Velocity
    code: str
    text: str
    gap_m: float


class Played(NamedTuple):
    """A run's end."""

    met: Met | None
    moments: list[Moment]
    way_m: float
    cost_us: list[float]  # of each decision, with the scans before it


class Run:
    """One run of a plan with a controller."""

    def __init__(
        self, plan: Plan, controller: Callable[[Fan], Controller], seed: int, *, timing: bool = False
    ) -> None:
        self.plan = plan
        self._timing = timing
        self._random = np.random.default_rng([seed, 68])
        laser = plan.laser
        beams = round(laser.view / laser.step) + 1
        self._angles: Floats = np.linspace(-laser.view / 2.0, laser.view / 2.0, beams)
        step = float(self._angles[1] - self._angles[0])
        self.controller = controller(Fan("/scan_raw", LASER, -laser.view / 2.0, step, NEAREST_M, FARTHEST_M))
        self._base = BaseController()
        self._base.brake_share = plan.brake_share
        self._odometry = Odometry(plan.drift, self._random)
        self._pose = Pose(0.0, 0.0, 0.0)
        self._twist = Twist()
        self._events: list[tuple[float, int, Callable[[float], object]]] = []
        self._numbers = itertools.count()
        self._scans_s = STARTS_S + float(self._random.uniform(0.0, 1.0 / laser.hz))
        self._decides_s = STARTS_S + float(self._random.uniform(0.0, PERIOD_S))
        self._command_s = 0.0
        self._sent = STILL
        self._sight_began: tuple[float, float] | None = None  # time and the robot's speed
        self._last_seen_s = -math.inf
        self._spent_us = 0.0
        self.moments: list[Moment] = []
        self.cost_us: list[float] = []

    def play(self) -> Played:
        """Play to the end of the plan, or to the first contact."""
        way_m, met, nearest_m = 0.0, None, math.inf
        for tick in range(round(self.plan.ends_s / TICK_S)):
            now_s = STARTS_S + tick * TICK_S
            while self._decides_s <= now_s or (self._events and self._events[0][0] <= now_s):
                self._next()
            self._move(now_s, tick)
            way_m += abs(self._twist.vx) * TICK_S
            if now_s + TICK_S >= self._scans_s:
                self._scan(now_s + TICK_S)
                self._scans_s += 1.0 / self.plan.laser.hz
            gap_m, part, at = self._gap(now_s + TICK_S - STARTS_S)
            if gap_m <= 0.0:
                met = self._contact(now_s + TICK_S - STARTS_S, part, at)
                break
            passed = now_s - STARTS_S > self.plan.meets_s + PASSED_S
            if passed and math.inf > gap_m > max(PASSED_M, nearest_m):
                break
            nearest_m = gap_m
        return Played(met, self.moments, way_m, self.cost_us)

    def _next(self) -> None:
        """Carry out what is due first: an arrival, or a decision."""
        if self._events and self._events[0][0] <= self._decides_s:
            at_s, _, event = heapq.heappop(self._events)
            event(at_s)
        else:
            self._decide(self._decides_s)
            self._decides_s += PERIOD_S

    def _decide(self, now_s: float) -> None:
        time_s = now_s - STARTS_S
        asked = self.plan.asked if time_s >= WARM_UP_S else STILL
        output = self._timed(lambda: self.controller.decide(asked, self._sent, now_s))
        if self._timing:
            self.cost_us.append(self._spent_us)
            self._spent_us = 0.0
        self._sent = output.velocity
        self._command_s = max(self._command_s, now_s + self._delay_s(self.plan.delays.command_s))
        velocity = output.velocity
        self._push(self._command_s, lambda at_s: self._base.command(Twist(*velocity), at_s))
        gap_m = self._gap(time_s)[0]
        self.moments.append(
            Moment(time_s, self._pose, self._twist.vx, self._sent, output.code, output.text, gap_m)
        )

    def _timed(self, work: Callable[[], Done]) -> Done:
        if not self._timing:
            return work()
        began_s = time.thread_time()
        done = work()
        self._spent_us += 1e6 * (time.thread_time() - began_s)
        return done

    def _move(self, now_s: float, tick: int) -> None:
        self._twist = twist = self._base.step(now_s, TICK_S)
        self._pose = _on(self._pose, twist, TICK_S)
        self._odometry.step(twist, TICK_S)
        if tick % ODOMETRY_TICKS == 0:
            odometry, stamp_s = self._odometry, now_s + TICK_S + ROBOT_CLOCK_S
            pose = Pose(float(odometry.x), float(odometry.y), float(odometry.yaw))
            velocity = Velocity(*map(float, odometry.velocity))
            self._push(
                now_s + TICK_S + self._delay_s(self.plan.delays.odometry_s),
                lambda at_s: self._timed(lambda: self.controller.odometry(stamp_s, at_s, pose, velocity)),
            )

    def _scan(self, now_s: float) -> None:
        """Measure. The beams are measured one after the other, about the time of the stamp."""
        laser, angles = self.plan.laser, self._angles
        lasts_s = laser.view / math.tau / laser.hz
        share = np.linspace(-0.5, 0.5, len(angles)) * lasts_s
        yaw = self._pose.yaw + share * self._twist.w
        x = self._pose.x + share * self._twist.vx * math.cos(self._pose.yaw)
        y = self._pose.y + share * self._twist.vx * math.sin(self._pose.yaw)
        origins = np.stack((x + LASER.x * np.cos(yaw), y + LASER.x * np.sin(yaw)), axis=1)
        people = self.plan.people(now_s - STARTS_S)
        things = people.joined(self.plan.things)
        hits = plane.cast(origins, yaw + angles, things)
        self._witness(hits, people, now_s)
        ranges, stamp_s = self._measured(hits.ranges), now_s + ROBOT_CLOCK_S
        self._push(
            now_s + lasts_s / 2.0 + self._delay_s(self.plan.delays.scan_s),
            lambda at_s: self._timed(lambda: self.controller.scan(stamp_s, at_s, ranges)),
        )

    def _witness(self, hits: plane.Hits, people: plane.Things, now_s: float) -> None:
        lines, standing = len(people.lines), len(self.plan.things.lines)
        of_people = (hits.things < lines) | (
            (hits.things >= lines + standing) & (hits.things < lines + standing + len(people.discs))
        )
        seen = np.count_nonzero(of_people & (hits.ranges < SEEN_M))
        if seen >= SEEN_BEAMS:
            time_s = now_s - STARTS_S
            if time_s - self._last_seen_s > LOST_S:
                self._sight_began = time_s, self._twist.vx
            self._last_seen_s = time_s

    def _measured(self, true: Floats) -> Ranges:
        laser, random, count = self.plan.laser, self._random, len(true)
        ranges = true + random.normal(0.0, laser.sigma_m, count)
        steps = np.diff(np.minimum(true, FARTHEST_M))
        edges = np.flatnonzero(np.abs(steps) > EDGE_M)
        mixed = edges[random.random(len(edges)) < laser.mixed]
        ranges[mixed] += random.uniform(0.0, 1.0, len(mixed)) * steps[mixed]
        ghosts = random.random(count) < GHOSTS
        ranges[ghosts] = random.uniform(0.1, 3.0, int(ghosts.sum()))
        ranges[ranges > FARTHEST_M] = np.inf
        ranges[ranges < NEAREST_M] = -np.inf
        ranges[random.random(count) < laser.lost] = np.nan
        return ranges.astype(np.float32)

    def _contact(self, time_s: float, part: str, at: tuple[float, float]) -> Met:
        x, y, yaw = self._pose
        ahead, left = at[0] - x - LASER.x * math.cos(yaw), at[1] - y - LASER.x * math.sin(yaw)
        bearing = math.remainder(math.atan2(left, ahead) - yaw, math.tau)
        mps = abs(self._twist.vx)
        if self._sight_began is None or time_s - self._last_seen_s > LOST_S:
            return Met(time_s, part, mps, bearing, 0.0, mps)
        began_s, seen_mps = self._sight_began
        return Met(time_s, part, mps, bearing, time_s - began_s, seen_mps)

    def _gap(self, time_s: float) -> tuple[float, str, tuple[float, float]]:
        """Return the distance from the hull to the nearest person, which part it is, and the person's place."""
        x, y, _ = self._pose
        gaps = [(math.inf, "", (0.0, 0.0))]
        for number, walk in enumerate(self.plan.walks):
            at = walk.trunk(time_s)[:2]
            trunk_m = math.dist(at, (x, y)) - HULL_M
            gaps.append((trunk_m - walk.build.trunk_m, "trunk", at))
            if trunk_m < NEAR_M:
                shins = walk.shins(time_s).tolist()
                gaps += [(math.dist(shin, (x, y)) - HULL_M - walk.build.shin_m, "shin", at) for shin in shins]
                if number == 0 and self.plan.trolley:
                    lines = Things(self.plan.people(time_s).lines)
                    gaps.append((float(lines.distances(np.array([(x, y)]))[0]) - HULL_M, "trolley", at))
        return min(gaps)

    def _delay_s(self, delay_s: float) -> float:
        return delay_s + JITTER_S * float(self._random.random())

    def _push(self, at_s: float, event: Callable[[float], object]) -> None:
        heapq.heappush(self._events, (at_s, next(self._numbers), event))


def _on(pose: Pose, twist: Twist, span_s: float) -> Pose:
    heading = pose.yaw + twist.w * span_s / 2.0
    return Pose(
        pose.x + span_s * twist.vx * math.cos(heading),
        pose.y + span_s * twist.vx * math.sin(heading),
        pose.yaw + span_s * twist.w,
    )


def codes(moments: list[Moment]) -> Counter[str]:
    """Return how many decisions had each code while the stick was held."""
    return Counter(moment.code for moment in moments if moment.time_s >= WARM_UP_S)
