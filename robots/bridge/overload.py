"""Whether this computer keeps up: how late a process's own loop wakes. Pure: time is an argument."""

from __future__ import annotations

import logging
from collections import deque

from robots.wire import Overload, OverloadedPart

log = logging.getLogger(__name__)

LATE_S = 0.1  # a loop that wakes so late had no processor, or too much else to do
TOLD_S = 0.2  # people are told only of what may cost them a command, which lives 0.3 s
KEPT_S = 5.0  # for so long after it, people are told


class LoopLateness:
    """How late the loop of one process (`part`) was in the last seconds. Each time that begins and ends is logged."""

    def __init__(self, part: OverloadedPart) -> None:
        self._part = part
        self._late: deque[tuple[float, float]] = deque()  # when, and how late
        self._worst_s = 0.0  # since this overload began

    def observe(self, late_s: float, now_s: float) -> None:
        """The loop woke `late_s` after it should have."""
        while self._late and now_s - self._late[0][0] > KEPT_S:
            self._late.popleft()
        if late_s >= LATE_S:
            self._late.append((now_s, late_s))
        if late_s >= TOLD_S:
            if not self._worst_s:
                log.warning("this computer is overloaded: the %s was %.2f s late", self._part, late_s)
            self._worst_s = max(self._worst_s, late_s)
        elif self._worst_s and not self._late:
            log.warning(
                "this computer keeps up again; the %s was up to %.2f s late", self._part, self._worst_s
            )
            self._worst_s = 0.0

    def since(self, begin_s: float) -> float:
        """Seconds by which the loop was late since then, all together."""
        return sum(late_s for at_s, late_s in self._late if at_s >= begin_s)

    def told(self, now_s: float) -> Overload | None:
        """The worst lateness of the last seconds, for people."""
        late = [late_s for at_s, late_s in self._late if now_s - at_s <= KEPT_S]
        worst_s = max(late, default=0.0)
        return Overload(self._part, round(worst_s, 2)) if worst_s >= TOLD_S else None
