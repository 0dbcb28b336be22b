"""Messages that arrived, in order, for tests."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from typing import Any

from tests.processes import PATIENCE_S


class Messages:
    """The messages of one source."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.put = self._queue.put

    def next(self, timeout_s: float = PATIENCE_S) -> Any:
        """Wait for the next message and return it."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            raise AssertionError(f"nothing on {self.source} within {timeout_s} s") from None

    def until(self, condition: Callable[[Any], Any], timeout_s: float = PATIENCE_S) -> Any:
        """Wait for a message for which `condition` is true; return it."""
        deadline = time.monotonic() + timeout_s
        last = None
        while time.monotonic() < deadline:
            last = self.next(timeout_s)
            if condition(last):
                return last
        raise AssertionError(f"no such message on {self.source} within {timeout_s} s; the last was\n{last}")

    def settle(self) -> None:
        """Wait for a message sent after this call. The next message may be older, so wait for two."""
        self.drain()
        self.next()
        self.next()

    def drain(self) -> list[Any]:
        """Take all messages that have arrived."""
        arrived = []
        while not self._queue.empty():
            arrived.append(self._queue.get())
        return arrived
