"""Real-time priority for the loops that carry commands, as the service unit of docs/deployment.md allows."""

from __future__ import annotations

import os
from pathlib import Path

from benchmarks.harness import progress
from benchmarks.parts import process_stats
from robots.shared.processes.scheduling import REAL_TIME
from script.stack.stack import Stack

# Settings of a stack whose processes ask for real-time priority, as under the service unit.
LIMIT_OF_UNIT = {"PYTHONPATH": str(Path(__file__).parent / "allowed")}


def prefer_loops(stack: Stack) -> bool:
    """Set the priority from outside, because processes here cannot raise their limit.

    Return False: not allowed.
    """
    bridges = [
        child
        for child in process_stats.children(stack.supervisor.pid)
        if "fleet.site.run_bridge" in process_stats.arguments(child)
    ]
    policy, param = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(REAL_TIME)
    try:
        for pid in (stack.web.pid, *bridges):
            os.sched_setscheduler(pid, policy, param)  # the main thread only
    except PermissionError:
        return False
    return True


def prefer_loops_or_say(stack: Stack) -> None:
    """Set the priority. If this is not allowed, report that the figures are for ordinary priority."""
    if not prefer_loops(stack):
        progress("Real-time priority is not allowed here: the limits apply to ordinary priority.")


def prefer_witness(pid: int) -> None:
    """Run this thread and the observer before attackers: driver and robot would be on other computers.

    Both get a lower real-time priority than the console's loops.
    """
    param = os.sched_param(REAL_TIME - 1)
    try:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, param)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, param)
    except PermissionError:
        return
