"""Threads that a process beside the bridge needs: the process ends when one of them fails."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable

from robots.shared.unreachable import Unreachable

log = logging.getLogger(__name__)


def start_vital(work: Callable[[], None], name: str) -> threading.Thread:
    """Run `work` on a thread. If it fails, the process ends; the bridge restarts it and reports failed requests."""
    thread = threading.Thread(target=_or_end, args=(work,), name=name, daemon=True)
    thread.start()
    return thread


def _or_end(work: Callable[[], None]) -> None:
    try:
        work()
    except Exception as error:
        log.error("the process ends: %s", error, exc_info=not isinstance(error, OSError | Unreachable))
        os._exit(1)
