"""Real-time priority for the loops that carry commands, as the service unit of docs/deployment.md lets them take it."""

from __future__ import annotations

import os
from pathlib import Path

from benchmarks.harness import progress
from benchmarks.parts import process_stats
from robots.processes.scheduling import REAL_TIME
from script.stack.stack import Stack

# Settings of a stack whose processes ask for real-time priority, as under the service unit.
LIMIT_OF_UNIT = {"PYTHONPATH": str(Path(__file__).parent / "allowed")}


def prefer_loops(stack: Stack) -> bool:
    """Set it from outside: here nobody raises the limit by which they would ask. False where that is not allowed."""
    bridges = [
        child
        for child in process_stats.children(stack.supervisor.pid)
        if "run_bridge" in process_stats.arguments(child)
    ]
    policy, param = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(REAL_TIME)
    try:
        for pid in (stack.web.pid, *bridges):
            os.sched_setscheduler(pid, policy, param)  # the main thread alone
    except PermissionError:
        return False
    return True


def prefer_loops_or_say(stack: Stack) -> None:
    """The same; where that is not allowed, figures are of ordinary priority, and whoever reads them must know."""
    if not prefer_loops(stack):
        progress("Nobody may give real-time priority here: the limits are held against ordinary priority.")


def prefer_witness(pid: int) -> None:
    """Let those who measure wait for no attacker either: driver and robot are other computers.

    This thread, and the observer with this process id, get less than the console's loops.
    """
    param = os.sched_param(REAL_TIME - 1)
    try:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, param)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, param)
    except PermissionError:
        return
