"""Cost of each of three simulated robots with their own masters and without viewers."""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from benchmarks.harness import Figure, progress
from benchmarks.parts import process_stats
from script.stack.processes import Child, end_all
from tests.processes import until
from tests.ros.support import Master, is_up

ROBOTS = 3
SETTLED_S = 3.0
MEASURED_S = 20.0
CORE_PERCENT = 15.0


def measure() -> list[Figure]:
    """Return percent of a core and memory of each simulator process."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-simulator-")))
        pids = [_started(stack, folder, number) for number in range(1, ROBOTS + 1)]
        time.sleep(SETTLED_S)
        progress(f"{ROBOTS} simulators for {MEASURED_S:.0f} s ...")
        began_s = time.monotonic()
        before_s = [process_stats.cpu_s(pid) for pid in pids]
        time.sleep(MEASURED_S)
        after_s = [process_stats.cpu_s(pid) for pid in pids]
        passed_s = time.monotonic() - began_s
        figures = []
        for number, (pid, before, after) in enumerate(zip(pids, before_s, after_s, strict=True), 1):
            used = 100.0 * (after - before) / passed_s
            figures.append(Figure(f"simulator {number}", used, "%", CORE_PERCENT))
            figures.append(Figure(f"simulator {number}: memory", process_stats.resident_mb(pid), "MB"))
        return figures


def _started(stack: ExitStack, folder: Path, number: int) -> int:
    """Start a master and its robot, which end with `stack`; return the robot's process id."""
    home = folder / str(number)
    home.mkdir()
    master = Master(home).start()
    stack.callback(master.stop)
    command = [sys.executable, "-m", "robots.simulator", f"--name=tiago-{number}", f"--seed={number}"]
    robot = Child("simulator", command, env=master.environment(), log=home / "robot.log")
    stack.callback(end_all, [robot])
    until(lambda: is_up(master, f"/simulator_tiago_{number}"), f"simulator {number}")
    return robot.pid
