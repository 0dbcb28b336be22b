"""How old is too old (docs/gate.md, 9).

Age counts from arrival on the bridge's monotonic clock, and only what carries a newer stamp counts as arrived.
A stamp is never compared with the console's clock: a robot whose clock is an hour off is not stale.
"""

from __future__ import annotations

from robots.bridge.gate import words

LASER_LATE_S = 0.22  # one missed scan of a 10 Hz laser is not late
LASER_HALT_S = 0.28  # with one tick more, zero is sent within 0.35 s of the last scan
LASER_STALE_S = 0.5
ODOMETRY_STALE_S = 0.2
SONAR_STALE_S = 0.5
DEPTH_STALE_S = 0.5
SONAR_STALE_MPS = 0.1
CLOCK_SET_BACK_S = 1.0  # stamps this much older than the last mean a clock that was set, not a late message


class Freshness:
    """When something new last came."""

    def __init__(self) -> None:
        self.stamp_s: float | None = None
        self._arrival_s: float | None = None

    def advances(self, stamp_s: float, arrival_s: float) -> bool:
        """Take note of an arrival; whether it is new. A frozen stamp, or a message that was overtaken, is not."""
        if self.stamp_s is not None and self.stamp_s - CLOCK_SET_BACK_S < stamp_s <= self.stamp_s:
            return False
        self.stamp_s = stamp_s
        self._arrival_s = arrival_s
        return True

    def age_s(self, now_s: float) -> float | None:
        """Seconds since the last new arrival; None if there never was one."""
        return None if self._arrival_s is None else max(now_s - self._arrival_s, 0.0)

    def within(self, limit_s: float, now_s: float) -> bool:
        """Whether something new came within `limit_s`."""
        return self._arrival_s is not None and now_s - self._arrival_s <= limit_s

    def silence(self, limit_s: float, now_s: float, why: str = "") -> str:
        """Reason text if nothing new came within `limit_s`: `why` if it is known; "" if data came."""
        if self.within(limit_s, now_s):
            return ""
        age_s = self.age_s(now_s)
        return why or ("nothing has come yet" if age_s is None else f"nothing new for {words.age(age_s)}")
