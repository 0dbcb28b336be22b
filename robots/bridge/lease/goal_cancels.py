"""Cancels the goals of all nodes at a stop, again and again while the stop is latched.

One cancel may be lost: the robot is away, a subscriber is not connected yet, other nodes send new goals. If the stop
is cleared before the robot is reached, the cancels go on until it is reached.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

from robots.bridge.watchdog.rules import CANCEL_AGAIN_S

log = logging.getLogger(__name__)

REACHED_S = 1.0  # after joining the robot: subscribers of cancel topics are connected by then


class GoalCancels:
    """The cancels of one robot. `cancel_all` sends one to every action. `stopped`: a stop is latched at the start."""

    def __init__(self, cancel_all: Callable[[], None], stopped: bool) -> None:
        self._cancel_all = cancel_all
        self._repeats = stopped
        self._sent_s = -math.inf
        self._joined_s = math.inf  # when the robot was joined

    def joined(self, now_s: float) -> None:
        """Note that the robot was joined."""
        self._joined_s = now_s

    def lost(self) -> None:
        """Note that the robot was lost."""
        self._joined_s = math.inf

    def repeat(self) -> None:
        """Repeat cancels from now on: stop was pressed."""
        self._repeats = True

    def send(self, now_s: float) -> None:
        """Cancel the goals of all nodes. A failed cancel must not block the stop."""
        self._sent_s = now_s
        try:
            self._cancel_all()
        except Exception:
            log.exception("cancelling all goals failed")

    def tick(self, latched: bool, now_s: float) -> None:
        """Send a cancel that is due. `latched`: the stop is not cleared."""
        if self._repeats:
            if now_s - self._sent_s >= CANCEL_AGAIN_S:
                self.send(now_s)
            self._repeats = latched or now_s - self._joined_s < REACHED_S
