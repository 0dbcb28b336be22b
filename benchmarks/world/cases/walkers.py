"""People who walk on two shins cross a robot's way, or come towards it; the stick is held fully ahead.

Everything is drawn by a seed (`benchmarks.world.walkers.plan`). A contact while the robot moves counts apart if
no braking could have prevented it: the person was first seen too late, or walked into a side that no laser sees.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

from msgspec import structs

from benchmarks.harness import Figure, progress, quantile
from benchmarks.world.controllers import CONTROLLERS
from benchmarks.world.play import played
from benchmarks.world.robot import tiago_profile
from benchmarks.world.walkers import plan as plans
from benchmarks.world.walkers.plan import Plan
from benchmarks.world.walkers.run import Met, Moment, Run
from robots.shared.configuration.gate_profile import GateProfile

RUNS = int(os.environ.get("FLEET_BENCH_WALKERS", "100"))
FIRST = int(os.environ.get("FLEET_BENCH_FIRST", "0"))  # first seed, to continue where another run ended
WORST = int(os.environ.get("FLEET_BENCH_WORST", "10"))  # runs that are printed
MOVING_MPS = 0.05  # a slower robot stands
MOVING_PERCENT = 0.5
STILL_PERCENT = 0.1
ANSWERS_S = 0.25  # from a place in a scan to a robot that brakes
TIMED = 20  # one run of this number is timed: the clock's calls take long
BRAKES_MPS2 = 1.0
WITH, STILL, UNHINDERED = "with people", "still room", "without gate"


class Job(NamedTuple):
    """One run: a seed, and in which way it is played."""

    seed: int
    manner: str = WITH


class End(NamedTuple):
    """How a run ended. `way`: driven part of the way that the stick asked for."""

    plan: str
    kind: str
    met: Met | None
    cause: str  # of a contact while the robot moved: "", "seen too late", "from where no laser looks"
    way: float
    slowed: float  # share of the decisions that a mover limited
    cost_us: list[float]

    @property
    def hit(self) -> bool:
        """Return whether the robot moved at the contact."""
        return self.met is not None and self.met.mps > MOVING_MPS


def measure(_: int) -> list[Figure]:
    """Return contacts by the robot's speed and by their cause, lost way, false slowing, and the gate's cost."""
    seeds = range(FIRST, FIRST + RUNS)
    jobs = [Job(seed, manner) for manner in (UNHINDERED, STILL) for seed in seeds[: max(RUNS // 4, 1)]]
    ends = dict(played("walkers", [*jobs, *(Job(seed) for seed in seeds)], play))
    people = {job.seed: end for job, end in ends.items() if job.manner == WITH}
    still = [end for job, end in ends.items() if job.manner == STILL]
    bare = [end for job, end in ends.items() if job.manner == UNHINDERED]
    _name_worst(people)
    return [
        Figure(f"walkers: contacts while it moves without gate, of {len(bare)}", _percent_hit(bare), "%"),
        *_contacts(list(people.values())),
        Figure(
            "walkers: way driven, of the asked way", 100.0 * _mean([end.way for end in people.values()]), "%"
        ),
        Figure(
            f"walkers: decisions that a mover limits in a still room, {len(still)} runs",
            100.0 * _mean([end.slowed for end in still]),
            "%",
            STILL_PERCENT,
        ),
        Figure("walkers: way driven in a still room", 100.0 * _mean([end.way for end in still]), "%"),
        *_costs([cost for end in people.values() for cost in end.cost_us]),
    ]


def _contacts(ends: Sequence[End]) -> list[Figure]:
    count, hits = len(ends), [end for end in ends if end.hit]
    speeds = [end.met.mps for end in hits if end.met]
    blamed = [end for end in hits if not end.cause]
    figures = [
        Figure(f"walkers: contacts while it moves, of {count}", _percent_hit(ends), "%"),
        Figure("walkers: of which seen in time", 100.0 * len(blamed) / count, "%", MOVING_PERCENT),
    ]
    for cause in ("seen too late", "from where no laser looks"):
        some = [end for end in hits if end.cause == cause]
        figures.append(Figure(f"walkers: of which {cause}", 100.0 * len(some) / count, "%"))
    for kind in plans.HEADINGS:
        some = [end for end in ends if end.kind == kind]
        figures.append(
            Figure(f"walkers, {kind}: contacts while it moves, of {len(some)}", _percent_hit(some), "%")
        )
    figures += [
        Figure(f"walkers: speed at these contacts: p{100 * share:.0f}", quantile(speeds, share), "m/s")
        for share in (0.5, 0.9, 1.0)
    ]
    rest = [end for end in ends if end.met and not end.hit]
    return [*figures, Figure(f"walkers: contacts at rest, of {count}", 100.0 * len(rest) / count, "%")]


def _costs(costs_us: list[float]) -> list[Figure]:
    return [
        Figure(
            f"walkers: a decision with the sensors before it: p{100 * share:.0f}",
            quantile(costs_us, share),
            "us",
        )
        for share in (0.5, 0.99)
    ]


def _percent_hit(ends: Sequence[End]) -> float:
    return 100.0 * sum(end.hit for end in ends) / len(ends) if ends else math.nan


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def _name_worst(ends: dict[int, End]) -> None:
    hits = [(end.met.mps, seed, end) for seed, end in ends.items() if end.hit and end.met and not end.cause]
    for mps, seed, end in sorted(hits, reverse=True)[:WORST]:
        progress(f"python -m benchmarks.world walkers {seed} --quiet    # {mps:.2f} m/s; {end.plan}")


def profile() -> GateProfile:
    """Return a TIAGo with its laser only: no depth camera helps it, and none limits it to a blind speed."""
    return structs.replace(tiago_profile(), has_depth=False, depth=None, sonar_poses={}, sonar_fov={})


def run_of(job: Job, controller: str = "gate") -> Run:
    """Return a run, ready to be played."""
    known = profile()
    drawn = plans.drawn(job.seed, alone=job.manner == STILL)
    name = "none" if job.manner == UNHINDERED else controller
    return Run(drawn, lambda fan: CONTROLLERS[name](known, fan), job.seed, timing=job.seed % TIMED == 0)


def play(job: Job) -> End:
    """Play one run."""
    run = run_of(job)
    ended = run.play()
    tried = [moment for moment in ended.moments if moment.time_s >= plans.WARM_UP_S]
    return End(
        str(run.plan),
        run.plan.kind,
        ended.met,
        cause_of(ended.met, run.plan),
        ended.way_m / _asked_m(run.plan, ended.moments),
        sum(moment.code == "mover" for moment in tried) / max(len(tried), 1),
        ended.cost_us,
    )


def cause_of(met: Met | None, plan: Plan) -> str:
    """Return why no braking could have prevented a contact while the robot moved; "" if it could."""
    if met is None or met.mps <= MOVING_MPS:
        return ""
    if met.seen_s >= ANSWERS_S + met.seen_mps / (BRAKES_MPS2 * min(plan.brake_share, 1.0)):
        return ""
    return "from where no laser looks" if abs(met.bearing) > plan.laser.view / 2.0 else "seen too late"


def _asked_m(plan: Plan, moments: Sequence[Moment]) -> float:
    """Return the way of a robot that nothing slows until the end of the run (it may end before the first decision)."""
    driven_s = max([moment.time_s for moment in moments], default=0.0) - plans.WARM_UP_S
    return max(plan.asked.vx * (driven_s - plan.asked.vx / 2.0), 0.01)
