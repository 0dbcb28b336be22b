"""Priority and garbage collection of processes whose loop carries commands or stops: bridge, watchdog, web process.

A process asks for priority only if the service unit allows it (docs/deployment.md), even if it runs as root. Threads
and children of the loop's thread have ordinary priority; a thread that answers a stop by HTTP asks for priority itself.
"""

from __future__ import annotations

import gc
import logging
import os
import resource
import signal
from contextlib import suppress

log = logging.getLogger(__name__)

REAL_TIME = 5  # of 1 to 99: above all ordinary processes, below the kernel and drivers
RUNAWAY_S = 0.2  # a loop that computes for this time without a pause gets ordinary priority
RUNAWAY_ENDS_S = 2.0  # after this time without a pause the kernel ends the process, and the robot stops
_OLD_S = 30.0


def ask_for_priority() -> str:
    """Ask for real-time priority or, if the limits forbid it, for a lower nice value. Returns the result in words.

    Call it from the main thread.
    """
    allowed = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    lowest_nice = 20 - resource.getrlimit(resource.RLIMIT_NICE)[0]
    got = "ordinary priority"
    try:
        if allowed > 0:
            priority = min(REAL_TIME, allowed)
            signal.signal(signal.SIGXCPU, _lower_priority)
            resource.setrlimit(resource.RLIMIT_RTTIME, (round(RUNAWAY_S * 1e6), round(RUNAWAY_ENDS_S * 1e6)))
            os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
            got = f"real-time priority {priority}"
        elif lowest_nice < 0:
            os.setpriority(os.PRIO_PROCESS, 0, lowest_nice)
            got = f"nice {lowest_nice}"
    except (OSError, ValueError) as error:
        got += f" ({error})"
    log.info("the event loop has %s", got)
    return got


def ask_for_stop_priority() -> None:
    """Ask for the lowest real-time priority, for a thread that answers a stop by HTTP.

    Otherwise, each time the thread waits, other work takes the core: pages, password hashes, programs of attackers on
    this computer.
    """
    if resource.getrlimit(resource.RLIMIT_RTPRIO)[0] > 0:
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))


def forbid_real_time() -> None:
    """Forbid real-time priority in this process from now on."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))


def _lower_priority(*_: object) -> None:
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    log.error("the event loop computed for %g s without a pause: it has ordinary priority now", RUNAWAY_S)


class Garbage:
    """Collects garbage only when the loop calls `collect`; never automatically, in any thread."""

    def __init__(self) -> None:
        gc.collect()
        gc.freeze()  # never examine the loaded modules again
        gc.disable()
        self._old_due_s = 0.0

    def collect(self, now_s: float, *, waits: bool) -> None:
        """Collect young objects; also old objects, at most every 30 s (330 s while somebody `waits` for the loop)."""
        if now_s >= self._old_due_s + (10 * _OLD_S if waits else 0.0):
            gc.collect()
            self._old_due_s = now_s + _OLD_S
        else:
            gc.collect(0)
