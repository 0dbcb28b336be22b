"""A memory limit for a process: a flood from a robot's network ends the process, not the computer."""

from __future__ import annotations

import logging
import os
import resource
import signal
import threading
from collections.abc import Callable

log = logging.getLogger(__name__)

STACK_BYTES = 1024 * 1024  # of each thread; the limit counts the whole stack, also its unused part


def limit_memory(most_bytes: int) -> None:
    """Limit memory: beyond it, allocation raises MemoryError or ends the process. Call it before threads start."""
    threading.stack_size(STACK_BYTES)
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        most_bytes = min(most_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, hard))


def lift_limit() -> None:
    """Lift the limit for the end of the process: its last work needs memory and threads."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def end_process() -> None:
    """End the process by the supervisor's signal: the event loop handles it, and leaves the robot at zero.

    Processes beside the bridge ignore that signal, and end at once.
    """
    if signal.getsignal(signal.SIGTERM) is signal.SIG_IGN:
        os._exit(1)
    os.kill(os.getpid(), signal.SIGTERM)


def end_without_memory(end: Callable[[], None] = end_process) -> None:
    """End the process: no memory is left. May be called on any thread, and more than once."""
    lift_limit()
    log.error("no memory is left: the process ends")
    end()
