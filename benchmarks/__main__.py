"""script/bench: run one benchmark, or list them."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from pathlib import Path

from benchmarks.gate.gate import record
from benchmarks.harness import machine, progress, show
from script.stack.processes import Ended, ended_by_signals

MODULES = (
    "web.api",
    "audit.audit",
    "web.bookings",
    "views.camera",
    "views.first_window",
    "web.console",
    "driving.drive",
    "gate.gate",
    "gate.gate_world",
    "growth.growth",
    "driving.network",
    "driving.recording",
    "views.replay",
    "web.rosbridge",
    "views.scene",
    "simulator",
    "driving.stick",
    "driving.stop",
    "views.viewers",
)
BENCHMARKS = {name.rpartition(".")[2].replace("_", "-"): f"benchmarks.{name}" for name in MODULES}

VARIABLES = (
    "Environment variables make a run shorter or longer, where the benchmark has them: FLEET_BENCH_PARTS (the parts to "
    "run; the docstring or PARTS of its module names them), FLEET_BENCH_REPEATS, FLEET_BENCH_SLOTS, "
    "FLEET_BENCH_SECONDS, FLEET_BENCH_COUNTS; of gate-world also FLEET_BENCH_DRAWS, FLEET_BENCH_FIRST (seed of the "
    "first draw) and FLEET_BENCH_METRES."
)


def main() -> int:
    """Return the exit status: 0 if all figures are within their limits."""
    parser = argparse.ArgumentParser(
        prog="script/bench", description="Without a name, lists what there is.", epilog=VARIABLES
    )
    parser.add_argument("name", nargs="?")
    parser.add_argument("--json", action="store_true", help="JSON alone on stdout")
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE",
        help="gate only: measure nothing, write a minute's drive to FILE for manage.py replay_gate",
    )
    asked = parser.parse_args()
    if asked.name is None:
        for name, module in BENCHMARKS.items():
            print(f"{name:<11} {(import_module(module).__doc__ or '').splitlines()[0]}")
        return 0
    if asked.name not in BENCHMARKS:
        parser.error(f"no such benchmark: {asked.name} ({', '.join(BENCHMARKS)})")
    if asked.record is not None:
        if asked.name != "gate":
            parser.error(f"{asked.name} records nothing, gate does")
        return record(asked.record)
    facts = machine()
    try:
        with ended_by_signals():
            figures = import_module(BENCHMARKS[asked.name]).measure()
    except Ended as ended:
        progress(f"Ended by {ended} before all was measured: there are no figures.")
        return 130
    return 0 if show(asked.name, figures, facts, as_json=asked.json) else 1


if __name__ == "__main__":
    sys.exit(main())
