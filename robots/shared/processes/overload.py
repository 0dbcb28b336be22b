"""Measure whether this computer is overloaded: how late a process's loop wakes. Pure: time is an argument."""

from __future__ import annotations

import logging
from collections import deque

from robots.shared.wire import Overload, OverloadedPart

log = logging.getLogger(__name__)

LATE_S = 0.1  # s: a loop this late had no processor time, or too much work
REPORTED_FROM_S = 0.2  # s: only longer delays are reported: a command, valid for 0.3 s, may expire in them
KEPT_S = 5.0  # s: time for which a delay is reported


class LoopLateness:
    """Lateness of the loop of one process (`part`) in the last seconds. Logs each begin and end of an overload."""

    def __init__(self, part: OverloadedPart) -> None:
        self._part = part
        self._late: deque[tuple[float, float]] = deque()  # time and lateness
        self._worst_s = 0.0  # since this overload began

    def observe(self, late_s: float, now_s: float) -> None:
        """Note that the loop woke `late_s` too late."""
        while self._late and now_s - self._late[0][0] > KEPT_S:
            self._late.popleft()
        if late_s >= LATE_S:
            self._late.append((now_s, late_s))
        if late_s >= REPORTED_FROM_S:
            if not self._worst_s:
                log.warning("this computer is overloaded: the %s was %.2f s late", self._part, late_s)
            self._worst_s = max(self._worst_s, late_s)
        elif self._worst_s and not self._late:
            log.warning(
                "this computer keeps up again; the %s was up to %.2f s late", self._part, self._worst_s
            )
            self._worst_s = 0.0

    def since(self, begin_s: float) -> float:
        """Return the sum of lateness since `begin_s`, in seconds."""
        return sum(late_s for at_s, late_s in self._late if at_s >= begin_s)

    def report(self, now_s: float) -> Overload | None:
        """Return the report for people: the worst delay of the last seconds."""
        late = [late_s for at_s, late_s in self._late if now_s - at_s <= KEPT_S]
        worst_s = max(late, default=0.0)
        return Overload(self._part, round(worst_s, 2)) if worst_s >= REPORTED_FROM_S else None
