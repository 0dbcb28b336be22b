"""A ceiling for a process's memory: what a robot's network makes it keep ends it, and not the computer."""

from __future__ import annotations

import resource
import threading

STACK_BYTES = 1024 * 1024  # of each thread; all of it counts, used or not


def limit_memory(most_bytes: int) -> None:
    """Beyond it allocating fails, with a MemoryError or the end of the process. Before there are threads."""
    threading.stack_size(STACK_BYTES)
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        most_bytes = min(most_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, hard))
