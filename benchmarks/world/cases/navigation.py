"""Navigation drives the robot to goals, and the gate watches: good navigation, and planners that are blind.

A blind planner drives at full speed straight at each goal, whatever stands there: ahead, backwards, or ahead
while somebody else turns the head aside during each drive. As in the bridge, the head is sent ahead again and
again. The watch judges with each odometry message. If it intervenes, it takes the base and cancels the goal.
The next goal follows when the robot has stood.
"""

from __future__ import annotations

import heapq
import math
from typing import Literal, NamedTuple, get_args

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.controllers import Fan, GateController
from benchmarks.world.loop import LOOKS_DOWN, STARTS_S, WARM_UP_S, Case, Conditions, Loop
from benchmarks.world.play import SCAN, played
from benchmarks.world.robot import tiago_profile
from benchmarks.world.witness import Contact, first_contact
from robots.bridge.gate import navigation_watch
from robots.bridge.head.head import AHEAD_TAKES_S, Aim
from robots.bridge.navigation.navigation_goals import LEAST_SPARE_M
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import Verdict
from robots.simulator.faults import Faults
from robots.simulator.navigation.navigator import GoalDrive, Navigator, Phase
from robots.simulator.physics import mujoco_world
from robots.simulator.worlds import load_world

START = mujoco_world.Pose(2.0, 1.8, 0.0)
PLACES = (
    (2.0, 1.8), (8.0, 2.0), (1.2, 5.5), (7.5, 5.0), (1.0, 2.6), (4.5, 5.9),
    (6.2, 4.5), (9.3, 0.8), (5.0, 2.5), (1.0, 6.3), (8.0, 6.2), (3.2, 1.2),
)  # fmt: skip
SIGMA_M = 0.1  # goals lie around these places
GOALS, BLIND_GOALS = 6, 12
LONGEST_S = 240.0
LONGEST_GOAL_S, THERE_M = 60.0, 0.3
HELD_S = 1.5  # the base is held this long after an intervention
AT_MOST, ENOUGH_M = 1.0, 300.0  # false interventions per 100 m, and the metres needed to measure this
WORST = 10
ASIDE_RAD = 1.2
ASIDE_FROM_S, ASIDE_FOR_S = (0.5, 3.0), (1.0, 8.0)  # after the start of each drive, and for how long
Kind = Literal["good", "blind", "backs", "aside"]
KINDS: tuple[Kind, ...] = get_args(Kind)
FAULTS = {
    "good": Faults(),
    "blind": Faults(navigation_blind=True),
    "backs": Faults(navigation_blind=True, navigation_backs=True),
    "aside": Faults(navigation_blind=True),
}


class Way(NamedTuple):
    """The arguments of one case."""

    seed: int
    kind: Kind


class Outcome(NamedTuple):
    """Result of one run."""

    contact: Contact | None
    way_m: float
    arrived: int
    goals: int
    interventions: list[str]  # in words
    closest_m: float  # gap at rest after an intervention


class Watched(GateController):
    """The gate as a watch: it judges with each odometry message."""

    loop: NavigationLoop | None = None

    def odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> None:
        super().odometry(stamp_s, arrival_s, pose, velocity)
        if self.loop is not None:
            self.loop.judge(arrival_s)


class NavigationLoop(Loop):
    """One run: goal after goal."""

    def __init__(
        self, case: Case, profile: GateProfile, goals: list[mujoco_world.Pose], seed: int, *, aside: bool
    ) -> None:
        self._watched: Watched
        self._watch = navigation_watch.Watch()
        self._turns = np.random.default_rng([seed, 37]) if aside else None
        # From when to when somebody turns the head, and in which direction.
        self._aside: tuple[float, float, Aim] | None = None
        super().__init__(case, lambda fan: self._watched_by(profile, fan), profile.limits, SCAN, seed)
        self._navigator = Navigator(self.robot)
        self._goals = goals
        self._held_until_s = self._goal_s = -math.inf
        self._commanded: Velocity | None = None  # by navigation, as the bridge receives it
        self.interventions: list[str] = []
        self.arrived = 0
        self.closest_m = math.inf
        self._watched.loop = self

    def _watched_by(self, profile: GateProfile, fan: Fan) -> Watched:
        self._watched = Watched(profile, fan)
        return self._watched

    def judge(self, now_s: float) -> None:
        """Judge the measured velocity, and take the base if it must brake."""
        drive = self._navigator.drive
        if drive is None or drive.phase is not Phase.DRIVING or now_s < self._held_until_s:
            return
        verdict = self._watch.judge(self._watched.gate, self._commanded, now_s)
        if verdict.code != "free":
            self._intervene(verdict, now_s)

    def _intervene(self, verdict: Verdict, now_s: float) -> None:
        x, y, yaw = self.robot.physics.pose
        gap_m = self.robot.physics.clearance_m()
        self.interventions.append(
            f"{now_s - STARTS_S:.1f} s at {x:.2f} {y:.2f} {math.degrees(yaw):.0f}: {verdict.code} {verdict.text}, "
            f"moves {verdict.asked.vx:.2f} {verdict.asked.w:.2f}, gap {gap_m:.3f}"
        )
        self._navigator.cancel()
        self._held_until_s = now_s + HELD_S
        self._send_zero(now_s)

    def _send_zero(self, now_s: float) -> None:
        self._command_s = max(self._command_s, self._arrives_s(now_s))
        heapq.heappush(
            self._events, (self._command_s, next(self._numbers), lambda at_s: self._obey(STILL, at_s))
        )

    def _decide(self, now_s: float) -> None:
        gate = self._watched.gate
        gate.observe_posture(self._watched.posture, now_s)
        gate.decide(STILL, STILL, now_s)  # the core does so all the time
        if now_s < self._held_until_s:
            self._send_zero(now_s)
            if self._held_until_s - now_s < 0.1:
                self.closest_m = min(self.closest_m, self.robot.physics.clearance_m())
            return
        drive = self._navigator.drive
        if drive is not None and drive.phase is Phase.DRIVING and not self._is_enough(drive, now_s):
            return
        self.arrived += drive is not None and drive.phase is Phase.REACHED
        self._navigator.cancel()
        if now_s - STARTS_S < WARM_UP_S:
            return
        # With too little room, a person would have to drive the robot away.
        if not self._goals or navigation_watch.spare_m(gate, now_s) < LEAST_SPARE_M:
            self._done = True
            return
        if not gate.looks_ahead(now_s):
            return
        self._goal_s = now_s
        self._watch = navigation_watch.Watch()
        self._aside = self._drawn_aside(now_s)
        self._navigator.go(self._goals.pop(0), now_s)

    def _drawn_aside(self, now_s: float) -> tuple[float, float, Aim] | None:
        if self._turns is None:
            return None
        from_s = now_s + float(self._turns.uniform(*ASIDE_FROM_S))
        pan = ASIDE_RAD * float(self._turns.choice((-1.0, 1.0)))
        return from_s, from_s + float(self._turns.uniform(*ASIDE_FOR_S)), Aim(pan, LOOKS_DOWN, AHEAD_TAKES_S)

    def _turn_head(self, now_s: float) -> None:
        if aim := self._head.forward(now_s):  # as the bridge does before and during each drive
            self._aim_head(aim)
        if self._aside and self._aside[0] <= now_s < self._aside[1]:
            self._aim_head(self._aside[2])
        super()._turn_head(now_s)

    def _hear(self, commanded: Velocity | None) -> None:
        self._commanded = commanded

    def _is_enough(self, drive: GoalDrive, now_s: float) -> bool:
        """Return whether the next goal is due. A blind planner never notices that the robot has arrived."""
        pose = self.robot.physics.pose
        there = self.robot.faults.navigation_blind and math.dist(pose[:2], drive.goal[:2]) < THERE_M
        return there or now_s - self._goal_s > LONGEST_GOAL_S

    def _look(self, now_s: float) -> None:
        super()._look(now_s)
        twist = self._navigator.step(now_s)
        commanded = None if twist is None else Velocity(twist.vx, twist.vy, twist.w)
        self._later(now_s, self._delays.odometry_s, lambda _at_s: self._hear(commanded))
        if twist is not None and self._mux.passes("nav_vel", now_s):
            self.robot.command(twist, now_s)


def measure(repeats: int) -> list[Figure]:
    """Return contacts with blind planners, and interventions with good navigation, which are all false."""
    jobs = [Way(seed, kind) for kind in KINDS for seed in range(repeats)]
    done = list(played("navigation", jobs, play))
    good = [outcome for way, outcome in done if way.kind == "good"]
    _name_worst(done)
    way_m = sum(outcome.way_m for outcome in good)
    false = sum(len(outcome.interventions) for outcome in good)
    goals = sum(outcome.goals for outcome in good)
    return [
        *(
            figure
            for kind in KINDS[1:]
            for figure in _blind(kind, [outcome for way, outcome in done if way.kind == kind])
        ),
        Figure("navigation, good: way", way_m, "m"),
        Figure("navigation, good: contacts", sum(o.contact is not None for o in good), "", 0.0),
        Figure("navigation, good: arrived", 100.0 * sum(o.arrived for o in good) / goals, "%"),
        Figure(
            "navigation, good: interventions",
            100.0 * false / way_m,
            "/100m",
            AT_MOST if way_m >= ENOUGH_M else None,
        ),
    ]


def _blind(kind: Kind, outcomes: list[Outcome]) -> list[Figure]:
    return [
        Figure(f"navigation, {kind}: way", sum(outcome.way_m for outcome in outcomes), "m"),
        Figure(f"navigation, {kind}: interventions", sum(len(o.interventions) for o in outcomes), ""),
        Figure(f"navigation, {kind}: contacts", sum(o.contact is not None for o in outcomes), "", 0.0),
        Figure(f"navigation, {kind}: closest at rest", 100.0 * min(o.closest_m for o in outcomes), "cm"),
    ]


def _name_worst(done: list[tuple[Way, Outcome]]) -> None:
    """Print the runs with a contact or a false intervention, with the commands that play them again."""
    for way, outcome in done:
        if outcome.contact or (way.kind == "good" and outcome.interventions):
            why = outcome.contact or "; ".join(outcome.interventions[:WORST])
            progress(f"python -m benchmarks.world navigation {way.seed} --kind {way.kind} --quiet  # {why}")


def play(way: Way) -> Outcome:
    """Play one run."""
    loop = loop_of(way.seed, way.kind)
    goals = len(loop._goals)
    trace = loop.play()
    return Outcome(first_contact(loop), trace.way_m, loop.arrived, goals, loop.interventions, loop.closest_m)


def loop_of(seed: int, kind: Kind = "good") -> NavigationLoop:
    """Return a run, ready to be played."""
    random = np.random.default_rng([seed, 31])
    case = Case(
        load_world("office"),
        START,
        lambda _random: _Nobody(),
        longest_s=LONGEST_S,
        conditions=Conditions(faults=((0.0, FAULTS[kind]),), head_pan=0.0),
    )
    goals = _goals(random, GOALS if kind == "good" else BLIND_GOALS)
    return NavigationLoop(case, tiago_profile(), goals, seed, aside=kind == "aside")


class _Nobody:
    """A driver who never holds the stick: navigation drives."""

    def hold(self, _seen: object) -> None:
        return None


def _goals(random: np.random.Generator, count: int) -> list[mujoco_world.Pose]:
    places = [PLACES[int(random.integers(len(PLACES)))] for _ in range(count)]
    return [
        mujoco_world.Pose(
            x + float(random.normal(0.0, SIGMA_M)),
            y + float(random.normal(0.0, SIGMA_M)),
            float(random.uniform(-math.pi, math.pi)),
        )
        for x, y in places
    ]
