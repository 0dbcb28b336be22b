"""Whether the gate keeps a simulated robot from everything: physics decides, beside the cone method and nav2's monitor.

Everything runs in one process per core, faster than real time; see `benchmarks.world`. FLEET_BENCH_REPEATS seeds of
each case (30), FLEET_BENCH_PARTS names the parts to run.
"""

from __future__ import annotations

import os

from benchmarks.harness import Figure, progress
from benchmarks.world import clutter, crossing, doors, drawn, faults, late, objects

REPEATS = int(os.environ.get("FLEET_BENCH_REPEATS", "30"))
PARTS = {
    "cold": drawn.measure_cold,
    "drawn": drawn.measure_drawn,
    "objects": objects.measure,
    "faults": faults.measure,
    "late": late.measure,
    "doors": doors.measure,
    "crossing": crossing.measure,
    "clutter": clutter.measure,
}
ASKED = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()


def measure() -> list[Figure]:
    """All parts, or those that are asked for."""
    figures = []
    for name in ASKED:
        progress(f"{name}: {REPEATS} repeats")
        figures += PARTS[name](REPEATS)
    return figures
