"""Which odometry messages of a robot at rest need no handling, because a newer one that waits shows the same. Pure."""

from __future__ import annotations

import math

# Only the newest message is taken this soon after the last one that was; after a longer silence all are, so that none
# is missing.
NEWEST_WITHIN_S = 0.18


class Standing:
    """Counts odometry messages that wait for the event loop, which calls `is_shown_by_newest` and `taken`."""

    def __init__(self) -> None:
        self._newest = 0
        self._since = math.inf  # the first message of the same publisher since which the robot rests
        self._run = 0
        self._stamp_s = self._taken_s = -math.inf  # stamps of the newest message, and of the last one taken

    def next(self) -> int:
        """Return the number of the next message."""
        return self._newest + 1

    def waits(self, stamp_s: float, run: int, *, rests: bool) -> None:
        """Note that the next message waits now. Not before: until then no other may be left out for it."""
        number = self._newest + 1
        if not rests or run != self._run:
            self._since = math.inf
        elif math.isinf(self._since):
            self._since = number
        self._stamp_s, self._run, self._newest = stamp_s, run, number

    def is_shown_by_newest(self, number: int) -> bool:
        """Return whether the newest message shows the same, without a gap after the last one that was taken."""
        since_s = self._stamp_s - self._taken_s
        return self._since <= number < self._newest and 0.0 <= since_s < NEWEST_WITHIN_S

    def taken(self, stamp_s: float) -> None:
        """Note the stamp of a message that is handled."""
        self._taken_s = stamp_s
