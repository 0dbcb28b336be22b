"""script/bench: run one benchmark, or list them."""

from __future__ import annotations

import argparse
import pkgutil
import sys
from importlib import import_module
from pathlib import Path

import benchmarks
from benchmarks.gate import record
from benchmarks.harness import machine, progress, show
from script.stack.processes import Ended, ended_by_signals


def main() -> int:
    """Returns the exit status: 0 if every figure holds."""
    parser = argparse.ArgumentParser(prog="script/bench", description="Without a name, lists what there is.")
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
        for name, described in known().items():
            print(f"{name:<11} {described}")
        return 0
    if asked.name not in known():
        parser.error(f"no such benchmark: {asked.name} ({', '.join(known())})")
    if asked.record is not None:
        if asked.name != "gate":
            parser.error(f"{asked.name} records nothing, gate does")
        return record(asked.record)
    facts = machine()
    try:
        with ended_by_signals():
            figures = import_module(f"benchmarks.{module_of(asked.name)}").measure()
    except Ended as ended:
        progress(f"Ended by {ended} before all was measured: there are no figures.")
        return 130
    return 0 if show(asked.name, figures, facts, as_json=asked.json) else 1


def known() -> dict[str, str]:
    """Return the benchmarks by name, each with the first line of its docstring."""
    modules = [
        import_module(f"benchmarks.{name}") for _, name, _ in pkgutil.iter_modules(benchmarks.__path__)
    ]
    return {
        module.__name__.rpartition(".")[2].replace("_", "-"): (module.__doc__ or "").splitlines()[0]
        for module in modules
        if hasattr(module, "measure")
    }


def module_of(name: str) -> str:
    """Return the name of a benchmark's module."""
    return name.replace("-", "_")


if __name__ == "__main__":
    sys.exit(main())
