"""Faults: full stick at an object while a sensor, the robot or its network fails.

The robot must not crash, and the page must show a reason.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from benchmarks.harness import Figure
from benchmarks.world.cases import objects
from benchmarks.world.loop import Case, Conditions, Moment
from benchmarks.world.play import loop_of, played
from robots.simulator.faults import Faults

FROM_S = 1.2  # the robot drives by then
THINGS = ("wall", "table leg", "table top")


class Fault(NamedTuple):
    """A fault, the codes of verdicts and speed limits that may report it, and the stick's angle."""

    conditions: Conditions
    codes: frozenset[str]
    limit: str | None = None
    angle: int = 0

    def is_reported_by(self, moment: Moment) -> bool:
        """Return whether the page shows this fault at that moment."""
        return moment.code in self.codes or any(self.limit == limit.code for limit in moment.limits)


def _at(**wrong: object) -> Conditions:
    return Conditions(faults=((FROM_S, Faults(**wrong)),))  # type: ignore[arg-type]


SCAN = frozenset({"scan_late", "scan_stale"})
ODOMETRY = frozenset({"odometry_stale"})
LATE = frozenset({"robot_late"})
HELD = frozenset({"obstacle", "near_miss"})
FAULTS: dict[str, Fault] = {
    "laser dead": Fault(_at(laser_dead=True), SCAN),
    "laser's stamps frozen": Fault(_at(laser_frozen=True), SCAN),
    "laser nothing but NaN": Fault(_at(laser_nan=True), SCAN | {"blind_direction"}),
    "odometry dead": Fault(_at(odom_dead=True), ODOMETRY),
    "odometry's stamps frozen": Fault(_at(odom_frozen=True), ODOMETRY),
    "100 ms later": Fault(Conditions(late_s=0.1), LATE | HELD),  # about the delay that the gate assumes
    **{
        f"{ms} ms later": Fault(Conditions(late_s=ms / 1000.0), LATE, "robot_late")
        for ms in (200, 300, 400, 500)
    },
    **{
        f"link slows by {ms} ms": Fault(Conditions(slows_to_s=ms / 1000.0), LATE, "robot_late")
        for ms in (200, 400)
    },
    "60 % brake": Fault(Conditions(faults=((0.0, Faults(brake_share=0.6)),)), HELD),
    "wheels slip 30 %": Fault(Conditions(faults=((0.0, Faults(slip_share=0.3)),)), HELD),
    "head away": Fault(Conditions(head_pan=1.3), frozenset({"head_away"})),
    "depth dead": Fault(_at(depth_dead=True), frozenset({"depth_stale"})),
    "sonars dead, in reverse": Fault(
        Conditions(faults=((0.0, Faults(sonar_dead=True)),)), frozenset({"sonar_stale"}), angle=180
    ),
    "robot's clock an hour off": Fault(Conditions(clock_s=3600.0), HELD),
}
UNSEEN = {"head away", "depth dead"}  # then table tops cannot be seen: only the blind speed is promised


class Failing(NamedTuple):
    """The arguments of one case."""

    name: str
    thing: str
    share: float
    seed: int


class Outcome(NamedTuple):
    """Result of one run."""

    touched: bool
    reported: bool  # the page shows a reason


def measure(repeats: int) -> list[Figure]:
    """Return crashes, and runs without a shown reason, fault by fault."""
    seeds = max(repeats // 3, 2)
    jobs = [
        Failing(name, thing, share, seed)
        for name in FAULTS
        for thing in THINGS
        if not (name in UNSEEN and thing == "table top")
        for share in objects.SHARES
        for seed in range(seeds)
    ]
    done = list(played("faults", jobs, play))
    figures = []
    for name in FAULTS:
        outcomes = [outcome for job, outcome in done if job.name == name]
        crashes = sum(outcome.touched for outcome in outcomes)
        silent = sum(not outcome.reported for outcome in outcomes)
        figures.append(Figure(f"{name}: crashes of {len(outcomes)}", crashes, "", 0.0))
        figures.append(Figure(f"{name}: runs without its reason", silent, "", 0.0))
    return figures


def play(failing: Failing) -> Outcome:
    """Play one case."""
    trace = loop_of(build(failing), "gate", failing.seed).play()
    fault = FAULTS[failing.name]
    reported = any(fault.is_reported_by(moment) for moment in trace.moments if moment.trying)
    return Outcome(bool(trace.touches), reported)


def build(failing: Failing) -> Case:
    """Build the case, straight ahead or in reverse."""
    fault = FAULTS[failing.name]
    whole = objects.build(objects.ObjectJob("gate", failing.thing, fault.angle, failing.share, failing.seed))
    return replace(whole, conditions=fault.conditions)
