"""How often a publisher is read: at once while it sends seldom, in batches when it floods."""

from __future__ import annotations

import threading
import time


class Pace:
    """The pause before each read of a topic's publishers, on rospy's thread of each.

    Of what arrives during the pause, rospy keeps the newest messages: a flood costs as much as 1,000 messages a second.
    """

    LEAST_QUEUE = 4  # messages of one read that are kept
    OFTEN_S = 0.005  # between two reads: more often is a flood
    PAUSE_S = 0.004
    REST_TIMES = 2.0  # after each read rest so many times as long: large messages do not take a whole core

    def __init__(self) -> None:
        self._here = threading.local()

    def __call__(self) -> float:
        """Return the pause in seconds."""
        now_s, worked_s = time.monotonic(), time.thread_time()
        before_s, before_worked_s = getattr(self._here, "before", (float("-inf"), worked_s))
        self._here.before = now_s, worked_s
        rest_s = self.REST_TIMES * (worked_s - before_worked_s)
        return max(rest_s, self.PAUSE_S if now_s - before_s < self.OFTEN_S else 0.0)
