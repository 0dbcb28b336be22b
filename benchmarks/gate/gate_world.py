"""Crashes of a simulated robot with the gate, and without it.

MuJoCo decides what is a crash. Each core has one process, which is faster than real time; see
`benchmarks.world`. The default takes five to ten minutes on two cores. FLEET_BENCH_REPEATS: seeds of each
case (default 1; figures.md uses 30). FLEET_BENCH_DRAWS: runs with drawn sensors (default 160: two of each
object, way and start). FLEET_BENCH_WALKERS: runs with people on two shins (default 100). FLEET_BENCH_METRES: metres
of random stick (default 100). FLEET_BENCH_PARTS: the parts to run. The part `decision` is `script/bench gate`: the
cost of a decision.
"""

from __future__ import annotations

import os
from collections.abc import Callable

from benchmarks.gate import gate
from benchmarks.harness import Figure, progress
from benchmarks.world.cases import (
    arm,
    clutter,
    crossing,
    doors,
    drawn,
    faults,
    late,
    leaving,
    navigation,
    objects,
    parked,
    walkers,
)

REPEATS = int(os.environ.get("FLEET_BENCH_REPEATS", "1"))
PARTS: dict[str, Callable[[int], list[Figure]]] = {
    "decision": lambda _: gate.measure(),
    "cold": drawn.measure_cold,
    "parked": parked.measure,
    "drawn": drawn.measure_drawn,
    "objects": objects.measure,
    "faults": faults.measure,
    "late": late.measure,
    "doors": doors.measure,
    "crossing": crossing.measure,
    "walkers": walkers.measure,
    "leaving": leaving.measure,
    "arm": arm.measure,
    "clutter": clutter.measure,
    "navigation": navigation.measure,
}
ASKED = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()


def measure() -> list[Figure]:
    """Run all parts, or those of FLEET_BENCH_PARTS."""
    figures = []
    for name in ASKED:
        progress(f"{name}: {REPEATS} repeats")
        figures += PARTS[name](REPEATS)
    return figures
