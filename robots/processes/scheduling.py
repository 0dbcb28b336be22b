"""Priority and garbage collection of processes whose loop carries commands or stops: bridge, watchdog, web process.

A process asks for priority where the service unit allows it (docs/deployment.md), and never because it is root. Threads
and children of the loop's thread have ordinary priority; a thread that answers a stop by HTTP asks for its own.
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
RUNAWAY_S = 0.2  # a loop that computes so long without a pause gets ordinary priority
RUNAWAY_ENDS_S = 2.0  # a loop that still computes then is ended, and the robot stops
_OLD_S = 30.0


def prefer_this_thread() -> str:
    """Ask for real-time priority, or else for a better nice value, where the limits allow it. Returns what it got.

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


def prefer_stop_thread() -> None:
    """Ask for the lowest real-time priority, for a thread that answers a stop by HTTP.

    Otherwise pages, hashes of passwords and attackers on this computer take the core at each of its waits.
    """
    if resource.getrlimit(resource.RLIMIT_RTPRIO)[0] > 0:
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))


def prefer_nobody() -> None:
    """Never ask for real-time priority in this process."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))


def _lower_priority(*_: object) -> None:
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    log.error("the event loop computed for %g s without a pause: it has ordinary priority now", RUNAWAY_S)


class Garbage:
    """Collects garbage only when the loop asks for it, never in between, in no thread."""

    def __init__(self) -> None:
        gc.collect()
        gc.freeze()  # loaded modules stay
        gc.disable()
        self._old_due_s = 0.0

    def collect(self, now_s: float, *, waits: bool) -> None:
        """Collect young objects, and sometimes old ones too; rarely while somebody `waits` for the loop."""
        if now_s >= self._old_due_s + (10 * _OLD_S if waits else 0.0):
            gc.collect()
            self._old_due_s = now_s + _OLD_S
        else:
            gc.collect(0)
