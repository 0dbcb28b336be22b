"""Cold starts, and sensors, delays, brakes and wheels that a seed draws and that the gate does not know.

The gate is to blame for contacts with objects that a sensor has seen or heard. Contacts with objects that no
sensor can have seen are counted separately (see `witness`). The worst runs are printed with the command that
plays them again.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Figure, progress
from benchmarks.world.cases import objects
from benchmarks.world.cases.objects import ObjectJob, Outcome
from benchmarks.world.loop import Case, Conditions
from benchmarks.world.play import at_most, played
from benchmarks.world.sensors import SLIPS, Sensors
from benchmarks.world.witness import count, worst_first
from robots.simulator.faults import Faults
from robots.simulator.sensors.odometry import Drift

DRAWS = int(os.environ.get("FLEET_BENCH_DRAWS", "160"))
FIRST = int(os.environ.get("FLEET_BENCH_FIRST", "0"))  # first seed, to continue where another run ended
WORST = int(os.environ.get("FLEET_BENCH_WORST", "10"))  # runs that are printed
WAYS = {0: "ahead", 45: "on an arc", 90: "turning", 135: "on an arc in reverse", 180: "in reverse"}
LATEST_S = 0.4
MOST_SLIP = 0.3
MOST_DRIFT = 0.05
BRAKES = (0.6, 1.2)


class End(NamedTuple):
    """One run: the command that plays it again, its case, and its outcome."""

    command: str
    job: ObjectJob
    drawn: str
    outcome: Outcome


def measure_cold(repeats: int) -> list[Figure]:
    """Return contacts by way and by object, for a parked robot with standard sensors."""
    jobs = [job._replace(cold=True) for job in objects.cases("gate", repeats)]
    once = [
        job._replace(pulls_again=False) for job in jobs if job.thing in objects.UNSEEN and job.angle >= 135
    ]
    ends = [
        End(_cold_command(job), job, "", outcome)
        for job, outcome in played("cold", [*jobs, *once], objects.play)
    ]
    refused = [end for end in ends if not end.job.pulls_again]
    touched = sum(end.outcome.touched is not None for end in refused)
    return [
        *figures("cold", [end for end in ends if end.job.pulls_again]),
        Figure(f"cold, table tops behind, one pull only: contacts of {len(refused)}", touched, "", 0.0),
    ]


def measure_drawn(_: int) -> list[Figure]:
    """Return contacts by way and by object, for robots with drawn sensors. Half of the robots were parked."""
    ends = []
    for seed, outcome in played("drawn", range(FIRST, FIRST + DRAWS), play):
        ends.append(End(f"drawn {seed}", job_of(seed), words_of(seed), outcome))
    cold = [end for end in ends if end.job.cold]
    warm = [end for end in ends if not end.job.cold]
    return [*figures("drawn, cold", cold), *figures("drawn, warm", warm)]


def job_of(seed: int) -> ObjectJob:
    """Return the case of a seed.

    Successive seeds go through all kinds, ways and starts, each equally often.
    """
    kind, rest = seed % len(objects.OBJECTS), seed // len(objects.OBJECTS)
    way, rest = rest % len(objects.ANGLES), rest // len(objects.ANGLES)
    share = objects.SHARES[rest // 2 % 2]
    return ObjectJob(
        "gate", list(objects.OBJECTS)[kind], objects.ANGLES[way], share, seed, cold=rest % 2 == 0
    )


def conditions_of(seed: int) -> Conditions:
    """Draw the conditions of a seed's run."""
    random = np.random.default_rng([seed, 13])
    sensors = Sensors.drawn(random)
    brake, late_s = float(random.uniform(*BRAKES)), float(random.uniform(0.0, LATEST_S))
    linear, angular = random.uniform(-MOST_DRIFT, MOST_DRIFT, 2).tolist()
    slip = float(random.uniform(0.0, MOST_SLIP)) if random.integers(SLIPS) == 0 else 0.0
    return Conditions(
        faults=((0.0, Faults(brake_share=brake, slip_share=slip)),),
        late_s=late_s,
        sensors=sensors,
        drift=Drift(linear_off=linear, angular_off=angular),
    )


def words_of(seed: int) -> str:
    """Return the drawn conditions of a seed in words."""
    drawn = conditions_of(seed)
    faults = drawn.faults[0][1]
    return (
        f"{drawn.sensors}; {1000 * drawn.late_s:.0f} ms late, brake {faults.brake_share:.2f}, "
        f"slip {100 * faults.slip_share:.0f} %, drift {100 * drawn.drift.linear_off:+.1f} % "
        f"{100 * drawn.drift.angular_off:+.1f} %"
    )


def build(seed: int) -> Case:
    return replace(objects.build(job_of(seed)), conditions=conditions_of(seed))


def play(seed: int) -> Outcome:
    """Play the case of a seed."""
    job = job_of(seed)
    return objects.outcome(build(seed), job.controller, job.seed)


def figures(where: str, ends: Sequence[End]) -> list[Figure]:
    """Return contacts with seen objects by way and by object, with a bound; unseen objects separately."""
    if not ends:
        return []
    shown = []
    for angle, way in WAYS.items():
        shown.append(_contacts(f"{where}, {way}", [end for end in ends if end.job.angle == angle]))
    for thing in objects.OBJECTS:
        shown.append(_contacts(f"{where}, {thing}", [end for end in ends if end.job.thing == thing]))
    met = count(end.outcome.touched for end in ends)
    percent = min(100.0 * at_most(met.known) / len(ends), 100.0)
    name_worst(where, ends)
    return [
        *shown,
        Figure(f"{where}: contacts with what was seen or heard, of {len(ends)}", met.known, "", 0.0),
        Figure(f"{where}: at most (95 %)", percent, "%"),
        Figure(f"{where}: contacts with what was seen too late, of {len(ends)}", met.late, ""),
        Figure(f"{where}: contacts with what no sensor can have seen, of {len(ends)}", met.unseen, ""),
    ]


def _contacts(name: str, ends: Sequence[End]) -> Figure:
    known = count(end.outcome.touched for end in ends).known
    return Figure(f"{name}: contacts with what was seen, of {len(ends)}", known, "", 0.0)


def name_worst(where: str, ends: Sequence[End]) -> None:
    """Print the worst runs, the commands that play them again, and their draws."""
    met = [(end.outcome.touched, end) for end in ends if end.outcome.touched]
    for contact, end in sorted(met, key=lambda pair: worst_first(pair[0]))[:WORST]:
        progress(f"python -m benchmarks.world {end.command} --quiet")
        progress(f"    {where}: {'cold' if end.job.cold else 'warm'}, {WAYS[end.job.angle]}, {contact}")
        if end.drawn:
            progress(f"    {end.drawn}")


def _cold_command(job: ObjectJob) -> str:
    return f'object "{job.thing}" {job.angle} {job.share} {job.seed} --cold{"" if job.pulls_again else " --once"}'
