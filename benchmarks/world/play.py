"""Play many cases at once, on all cores."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from benchmarks.harness import progress
from benchmarks.world.controllers import CONTROLLERS, GateController
from benchmarks.world.loop import Case, Loop, Trace
from benchmarks.world.robot import tiago_profile
from robots.bridge.gate_trace import Recorder

Job = TypeVar("Job")
Outcome = TypeVar("Outcome")
SCAN = "/scan_raw"


def at_most(crashes: int) -> float:
    """Return the upper 95 % bound of the expected number of crashes (Poisson): 3.0 if there was none."""
    low, high = 0.0, 3.0 * crashes + 10.0
    while high - low > 1e-6:
        middle = (low + high) / 2.0
        terms = (math.exp(n * math.log(middle) - middle - math.lgamma(n + 1.0)) for n in range(crashes + 1))
        low, high = (middle, high) if sum(terms) > 0.05 else (low, middle)
    return high


def loop_of(case: Case, controller: str, seed: int) -> Loop:
    """Return a run of `case`, ready to be played."""
    profile = case.conditions.sensors.profile(tiago_profile())
    return Loop(case, lambda fan: CONTROLLERS[controller](profile, fan), profile.limits, SCAN, seed)


def recorded(loop: Loop, path: Path) -> Trace:
    """Play a run of our gate, and record its input and verdicts."""
    if not isinstance(loop.controller, GateController):
        raise ValueError("only our own gate can be recorded")
    with Recorder(path, loop.controller.gate.profile) as recorder:
        recorder.recorded(loop.controller.gate)
        return loop.play()


def played(name: str, jobs: Sequence[Job], play: Callable[[Job], Outcome]) -> Iterator[tuple[Job, Outcome]]:
    """Yield each job with its outcome, in order.

    `play` must be importable, because separate processes run it.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    context = multiprocessing.get_context("spawn")
    with context.Pool(len(os.sched_getaffinity(0))) as pool:
        for number, pair in enumerate(zip(jobs, pool.imap(play, jobs, chunksize=4), strict=True), 1):
            yield pair
            if number % max(len(jobs) // 10, 1) == 0:
                progress(f"{name}: {number} of {len(jobs)}")
