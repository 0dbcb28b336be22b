"""Passes messages from the robot's threads to the event loop: a few wait per source, and one call takes them all.

A message that can wait does not wake the loop. The loop takes it before the next message that cannot wait, or
at its next tick.

A source that uses more than its share of the loop's time is cut off for a while: the loop also sends zeros
and stops.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from typing import Protocol

from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import say

# Share of the loop's time for one source. Scans of 700 beams at 15 Hz take 0.02, of 1081 beams at 40 Hz 0.06;
# a slow computer needs three times as much.
LOOP_SHARE = 0.3

EVENTS_WAIT = 50  # messages of one kind that wait for the event loop: ended goals, spoken words

Call = Callable[[], None]


class Speaker(Protocol):
    """The sender of a message."""

    topic: str

    def drop(self, why: str) -> None:
        """Cut the sender off for a while."""


class Mailboxes:
    """One box for each source. `later` runs a call on the loop soon; it is thread-safe.

    While `hurry` returns true, every message wakes the loop; `hurry` is called on the robot's threads. `worked`
    returns the processor time (s) of the loop's thread: waiting does not count.
    """

    def __init__(
        self,
        later: Callable[[Call], None],
        hurry: Callable[[], bool] = lambda: True,
        speaker: Callable[[], Speaker | None] = lambda: None,
        worked: Callable[[], float] = time.thread_time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._later = later
        self._hurry = hurry
        self._speaker = speaker
        self._worked = worked
        self._clock = clock
        self._boxes: dict[Hashable, deque[tuple[Call, Speaker | None]]] = {}
        self._budgets: dict[Hashable, TokenBucket] = {}
        # Sources with messages that did not wake the loop; True if a later message of the source woke it.
        self._waiting: dict[Hashable, bool] = {}
        self._lock = threading.Lock()

    def post(self, source: Hashable, call: Call, depth: int = 1, *, can_wait: bool = False) -> None:
        """Run `call` on the loop. If `depth` calls of this source wait already, the oldest is dropped."""
        waits = can_wait and not self._hurry()
        with self._lock:
            box = self._boxes.setdefault(source, deque())
            unheard = not box or self._waiting.get(source) is False
            while len(box) >= depth:
                box.popleft()
            box.append((call, self._speaker()))
            if unheard and (waits or source in self._waiting):
                self._waiting[source] = not waits
        if unheard and not waits:
            self._later(lambda: self._take_with(source))

    def take_waiting(self) -> None:
        """Take all waiting messages, on the event loop; messages that arrive during this call wait."""
        for _ in range(len(self._waiting)):
            with self._lock:
                source = next(iter(self._waiting))
                del self._waiting[source]
            self.take(source)

    def _take_with(self, source: Hashable) -> None:
        try:
            self.take_waiting()  # a scan is paired with odometry that came before it
        finally:
            self.take(source)

    def take(self, source: Hashable) -> None:
        """Take all messages of a source now, on the event loop."""
        with self._lock:
            box = self._boxes.get(source, deque())
            calls = list(box)
            box.clear()
        budget = self._budgets.setdefault(source, TokenBucket(LOOP_SHARE, LOOP_SHARE))
        for call, speaker in calls:
            began_s = self._worked()
            try:
                call()
            finally:
                took_s = self._worked() - began_s
                if not budget.spend(self._clock(), took_s) and speaker is not None:
                    speaker.drop(
                        say("takes more than {percent:.0f}% of the bridge’s time", percent=100.0 * LOOP_SHARE)
                    )
