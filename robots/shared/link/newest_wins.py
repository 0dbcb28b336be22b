"""Messages that wait for a reader of one topic: newest wins, and nothing grows. Pure: time is an argument."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

PATIENCE_S = 0.05  # an item beyond the queue may wait so long: nothing is lost while the reader keeps up
MOST_WAITING = 1000
# After an item that took longer than `SHORT_S` rest so many times as long: no topic takes the whole process
REST_TIMES, SHORT_S = 2.0, 0.003

T = TypeVar("T")


class NewestWins(Generic[T]):
    """At most one item each `every_s`. If the reader is behind, the newest `queue` items wait."""

    def __init__(self, every_s: float, queue: int, most_bytes: int) -> None:
        self.every_s = every_s
        self.queue = queue
        self._most_bytes = most_bytes
        self._due_s = float("-inf")
        self._first: deque[tuple[int, T]] = deque()
        self._waiting: deque[tuple[float, int, T]] = deque()
        self._bytes = 0

    def put_first(self, item: T, size: int) -> None:
        """Let an item from before this reader go before all others, at once."""
        self._first.append((size, item))

    def offer(self, item: T, size: int, now_s: float) -> None:
        """Let an item wait. It replaces older ones beyond the queue."""
        waiting = self._waiting
        waiting.append((now_s, size, item))
        self._bytes += size
        while len(waiting) > 1:
            since_s, oldest_size, _ = waiting[0]
            is_late = self.every_s > 0.0 or now_s - since_s > PATIENCE_S
            is_much = len(waiting) > MOST_WAITING or self._bytes > self._most_bytes
            if not (is_much or (is_late and len(waiting) > self.queue)):
                break
            waiting.popleft()
            self._bytes -= oldest_size

    def due_s(self) -> float | None:
        """Return when the next item may be sent; None: none waits."""
        if self._first:
            return float("-inf")
        return self._due_s if self._waiting else None

    def next_size(self) -> int:
        """Return the size of the next item."""
        return self._first[0][0] if self._first else self._waiting[0][1]

    def pop(self, now_s: float) -> T:
        """Take the next item."""
        if self._first:
            return self._first.popleft()[1]
        _, size, item = self._waiting.popleft()
        self._bytes -= size
        # After a late item the next may be a little early: so no item of a steady topic is lost
        self._due_s = max(self._due_s, now_s - self.every_s / 2.0) + self.every_s
        return item

    def rest(self, now_s: float, worked_s: float) -> None:
        """Note how long the last item took."""
        if worked_s > SHORT_S:
            self._due_s = max(self._due_s, now_s + REST_TIMES * worked_s)
