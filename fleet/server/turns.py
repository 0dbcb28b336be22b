"""Handle bytes of strangers piece by piece, one in each turn of the loop: a stick waits for one piece at most."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any


class Turns:
    """Work in the order in which it came. `soon` calls something in the next turn of the loop."""

    def __init__(self, soon: Callable[[Callable[[], None]], Any]) -> None:
        self._soon = soon
        self._waiting: deque[Callable[[], None]] = deque()

    def take(self, work: Callable[[], None]) -> None:
        """Run this in a separate turn of the loop."""
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
