"""Runs requests to the robot, which may take a while, outside the control loop's thread."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable

from robots.shared.unreachable import Unreachable

log = logging.getLogger(__name__)

Call = Callable[[], None]


class Worker:
    """Runs jobs one after another on its own thread, which ends with the process."""

    def __init__(self, name: str) -> None:
        self._waiting: list[Call] = []
        self._news = threading.Condition()
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def do(self, call: Call) -> None:
        """Queue a call and return. A call that waits already is not queued twice."""
        with self._news:
            if call not in self._waiting:
                self._waiting.append(call)
                self._news.notify()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting)
                call = self._waiting.pop(0)
            try:
                call()
            except Unreachable as error:
                log.warning("a request to the robot failed: %s", error)
            except Exception:  # any answer of a hostile robot; the next call runs
                log.exception("a request to the robot failed")


class RateLimit:
    """Runs a call at once, but at most every `gap_s`: all requests within this time cause one later call."""

    def __init__(self, what: Callable[[], None], gap_s: float) -> None:
        self._what = what
        self._gap_s = gap_s
        self._due_s = -math.inf  # time of the last start, or of the next one
        self._lock = threading.Lock()

    def do(self) -> None:
        """Request a call. Returns at once."""
        with self._lock:
            now_s = time.monotonic()
            if self._due_s > now_s:
                return
            self._due_s = max(now_s, self._due_s + self._gap_s)
            timer = threading.Timer(self._due_s - now_s, self._what)
            timer.daemon = True
            timer.start()
