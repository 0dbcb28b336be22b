"""The robot's clock as the bridge knows it. The processes that it starts get it, too."""

from __future__ import annotations

from msgspec import Struct

from robots.shared.configuration.bridge_config import CLOCK_SKEW_S

LONGEST_AGE_S = 366 * 24 * 3600.0  # a larger difference shows that a stamp is no time of day


class RobotClock(Struct, frozen=True):
    """`skew_s`: the robot's clock minus ours, by its odometry; None: no odometry. `simulated`: it has its own pace."""

    skew_s: float | None = None
    simulated: bool = False

    def differs(self, other: RobotClock, by_s: float) -> bool:
        """Return whether this is another clock, or differs by more than `by_s`."""
        if self.simulated != other.simulated or self.skew_s is None or other.skew_s is None:
            return self != other
        return abs(self.skew_s - other.skew_s) > by_s

    def age_s(self, stamp_s: float, wall_s: float) -> float | None:
        """Return the age (s) of a stamp at our time `wall_s` by the robot's clock; None: that is not known."""
        age_s = wall_s + (self.skew_s or 0.0) - stamp_s
        if self.simulated or stamp_s <= 0.0 or not -CLOCK_SKEW_S <= age_s <= LONGEST_AGE_S:
            return None
        return max(age_s, 0.0)
