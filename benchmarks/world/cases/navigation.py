"""The robot drives itself to places, and the gate watches: by its own good navigation, and by a planner that is blind.

The blind planner drives at full speed straight at each goal, whatever stands there. As in the bridge, the watch judges
with each odometry message, takes the base and cancels the goal; the next goal follows when the robot has stood.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.controllers import Fan, Ours
from benchmarks.world.loop import STARTS_S, WARM_UP_S, Case, Conditions, Loop
from benchmarks.world.play import SCAN, played
from benchmarks.world.robot import tiago_profile
from benchmarks.world.witness import Contact, first_contact
from robots.bridge.gate import navigation_watch
from robots.bridge.gate.values import STILL, GateProfile, Pose, Velocity, Verdict
from robots.bridge.navigation.going import LEAST_SPARE_M
from robots.simulator.faults import Faults
from robots.simulator.navigation.navigator import Going, Navigator, Phase
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
AT_MOST, ENOUGH_M = 1.0, 300.0  # false interventions per 100 m; fewer metres say nothing
WORST = 10


class Way(NamedTuple):
    """The arguments of one case."""

    seed: int
    blind: bool


class Outcome(NamedTuple):
    """Result of one run."""

    contact: Contact | None
    way_m: float
    arrived: int
    goals: int
    interventions: list[str]  # in words
    closest_m: float  # gap at rest after an intervention


class Watched(Ours):
    """The gate as a watch: it judges with each odometry message."""

    loop: NavigationLoop | None = None

    def odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> None:
        super().odometry(stamp_s, arrival_s, pose, velocity)
        if self.loop is not None:
            self.loop.judge(arrival_s)


class NavigationLoop(Loop):
    """One run: goal after goal."""

    def __init__(self, case: Case, profile: GateProfile, goals: list[mujoco_world.Pose], seed: int) -> None:
        self._watched: Watched
        super().__init__(case, lambda fan: self._watch(profile, fan), profile.limits, SCAN, seed)
        self._navigator = Navigator(self.robot)
        self._goals = goals
        self._held_until_s = self._goal_s = -math.inf
        self._commanded: Velocity | None = None  # by navigation, as the bridge hears it
        self.interventions: list[str] = []
        self.arrived = 0
        self.closest_m = math.inf
        self._watched.loop = self

    def _watch(self, profile: GateProfile, fan: Fan) -> Watched:
        self._watched = Watched(profile, fan)
        return self._watched

    def judge(self, now_s: float) -> None:
        """Judge the measured velocity; take the base where it must brake."""
        going = self._navigator.going
        if going is None or going.phase is not Phase.DRIVING or now_s < self._held_until_s:
            return
        verdict = navigation_watch.judge(self._watched.gate, self._commanded, now_s)
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
        going = self._navigator.going
        if going is not None and going.phase is Phase.DRIVING and not self._is_enough(going, now_s):
            return
        self.arrived += going is not None and going.phase is Phase.REACHED
        self._navigator.cancel()
        if now_s - STARTS_S < WARM_UP_S:
            return
        if (
            not self._goals or navigation_watch.spare_m(gate, now_s) < LEAST_SPARE_M
        ):  # then a person must drive it away
            self._done = True
            return
        self._goal_s = now_s
        self._navigator.go(self._goals.pop(0), now_s)

    def _hear(self, commanded: Velocity | None) -> None:
        self._commanded = commanded

    def _is_enough(self, going: Going, now_s: float) -> bool:
        """Return whether the next goal is due: a blind planner never notices that it is there."""
        pose = self.robot.physics.pose
        there = self.robot.faults.navigation_blind and math.dist(pose[:2], going.goal[:2]) < THERE_M
        return there or now_s - self._goal_s > LONGEST_GOAL_S

    def _look(self, now_s: float) -> None:
        super()._look(now_s)
        twist = self._navigator.step(now_s)
        commanded = None if twist is None else Velocity(twist.vx, twist.vy, twist.w)
        self._later(now_s, self._delays.odometry_s, lambda _at_s: self._hear(commanded))
        if twist is not None and self._mux.passes("nav_vel", now_s):
            self.robot.command(twist, now_s)


def measure(repeats: int) -> list[Figure]:
    """Contacts with a blind planner; interventions with good navigation, all of which are false."""
    jobs = [Way(seed, True) for seed in range(repeats)]
    jobs += [Way(seed, False) for seed in range(repeats)]
    done = list(played("navigation", jobs, play))
    blind = [outcome for way, outcome in done if way.blind]
    good = [outcome for way, outcome in done if not way.blind]
    _name_worst(done)
    way_m = sum(outcome.way_m for outcome in good)
    false = sum(len(outcome.interventions) for outcome in good)
    goals = sum(outcome.goals for outcome in good)
    return [
        Figure("navigation, blind: way", sum(outcome.way_m for outcome in blind), "m"),
        Figure("navigation, blind: interventions", sum(len(o.interventions) for o in blind), ""),
        Figure("navigation, blind: contacts", sum(o.contact is not None for o in blind), "", 0.0),
        Figure("navigation, blind: closest at rest", 100.0 * min(o.closest_m for o in blind), "cm"),
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


def _name_worst(done: list[tuple[Way, Outcome]]) -> None:
    """Say which runs had a contact or a false intervention, and how they are played again."""
    for way, outcome in done:
        if outcome.contact or (not way.blind and outcome.interventions):
            blind = " --blind" if way.blind else ""
            why = outcome.contact or "; ".join(outcome.interventions[:WORST])
            progress(f"python -m benchmarks.world navigation {way.seed}{blind} --quiet  # {why}")


def play(way: Way) -> Outcome:
    """Play one."""
    loop = loop_of(way.seed, blind=way.blind)
    goals = len(loop._goals)
    trace = loop.play()
    return Outcome(first_contact(loop), trace.way_m, loop.arrived, goals, loop.interventions, loop.closest_m)


def loop_of(seed: int, *, blind: bool = False) -> NavigationLoop:
    """A run, ready to be played."""
    random = np.random.default_rng([seed, 31])
    faults = ((0.0, Faults(navigation_blind=True)),) if blind else ()
    case = Case(
        load_world("office"),
        START,
        lambda _random: _Nobody(),
        longest_s=LONGEST_S,
        conditions=Conditions(faults=faults, head_pan=0.0),
    )
    return NavigationLoop(case, tiago_profile(), _goals(random, BLIND_GOALS if blind else GOALS), seed)


class _Nobody:
    """A stick at rest: navigation drives."""

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
