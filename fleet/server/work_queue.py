"""Handle bytes of unknown clients in pieces, one per turn of the loop: drive input waits for one piece."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any


class WorkQueue:
    """Pieces of work, in order of arrival. `soon(work)` must call `work` in the next turn of the loop."""

    def __init__(self, soon: Callable[[Callable[[], None]], Any]) -> None:
        self._soon = soon
        self._waiting: deque[Callable[[], None]] = deque()

    def add(self, work: Callable[[], None]) -> None:
        """Run `work` in a separate turn of the loop."""
        self._waiting.append(work)
        if len(self._waiting) == 1:
            self._soon(self._next)

    def _next(self) -> None:
        try:
            self._waiting[0]()
        finally:
            self._waiting.popleft()
            if self._waiting:
                self._soon(self._next)
