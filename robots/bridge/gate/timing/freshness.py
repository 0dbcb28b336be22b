"""Age of sensor data and its limits (docs/gate.md, 9).

Age counts from arrival on the bridge's monotonic clock. Only a message with a newer stamp counts as an arrival.
Stamps are never compared with the console's clock: the robot's clock may be wrong by an hour, or simulated.
"""

from __future__ import annotations

import math

from robots.shared.sentences import say

LASER_LATE_S = 0.22  # one missed scan of a 10 Hz laser is not late
LASER_HALT_S = 0.28  # with one tick more, zero is sent within 0.35 s of the last scan
LASER_STALE_S = 0.5
ODOMETRY_STALE_S = 0.2
SONAR_STALE_S = 0.5
DEPTH_STALE_S = 0.5
SONAR_STALE_MPS = 0.1
CLOCK_SET_BACK_S = 1.0  # a stamp that is older by this much means that the clock was set back
# so many older stamps in a row that advance mean the same: a time server set it back by less
SET_BACK_MESSAGES = 3


class Freshness:
    """Time of the last new message of one source."""

    def __init__(self) -> None:
        self.stamp_s: float | None = None
        self.arrival_s: float | None = None
        self._older: list[float] = []  # stamps that are older than `stamp_s` and advance
        self._repeated_s = -math.inf  # arrival of the last message that was not new

    def advances(self, stamp_s: float, arrival_s: float) -> bool:
        """Note an arrival; return whether it is new. A repeated or older stamp is not new."""
        if self.stamp_s is not None and self.stamp_s - CLOCK_SET_BACK_S < stamp_s <= self.stamp_s:
            self._repeated_s = arrival_s
            if not self._is_set_back(stamp_s):
                return False
        self.stamp_s = stamp_s
        self.arrival_s = arrival_s
        self._older.clear()
        return True

    def _is_set_back(self, stamp_s: float) -> bool:
        if self._older and stamp_s <= self._older[-1]:
            self._older.clear()
        self._older.append(stamp_s)
        return len(self._older) >= SET_BACK_MESSAGES

    def age_s(self, now_s: float) -> float | None:
        """Return the seconds since the last new arrival; None before the first."""
        return None if self.arrival_s is None else max(now_s - self.arrival_s, 0.0)

    def within(self, limit_s: float, now_s: float) -> bool:
        """Return whether a new message came within `limit_s`."""
        return self.arrival_s is not None and now_s - self.arrival_s <= limit_s

    def silence(self, limit_s: float, now_s: float, why: str = "") -> str:
        """Return a reason if no new message came within `limit_s` (`why` if given), else ""."""
        if self.within(limit_s, now_s):
            return ""
        if now_s - self._repeated_s <= limit_s:
            return say("messages come, but their stamps do not advance")
        age_s = self.age_s(now_s)
        return why or (
            say("nothing has come yet") if age_s is None else say("nothing new for {age:age}", age=age_s)
        )
