"""Computes a picture's age from its stamp, also if the robot's clock differs from this computer's. Pure."""

from __future__ import annotations

from collections import deque

from robots.bridge.robot_clock import RobotClock
from robots.shared.configuration.bridge_config import CLOCK_SKEW_S

OTHER_CLOCK_S = 10.0  # no picture is this late: then its stamp comes from another clock than the odometry's
REAL_CLOCK = RobotClock()  # of which no odometry told anything yet
WINDOW_S = 30.0  # the smallest delay within this time shows how much the clocks differ


class PictureAge:
    """Ages of one camera's pictures on arrival.

    While the smallest delay of the last `WINDOW_S` is between 0 and `CLOCK_SKEW_S`, the clocks agree and the
    delay is the age. Otherwise the age is the delay minus the smallest delay. The smallest delay may also be
    the delay of the robot's odometry: without it, pictures that are always late would look new. The stamps of a
    simulated clock, which has its own pace, tell no age.
    """

    def __init__(self) -> None:
        # Arrival and delay (s); delays grow from left to right.
        self._delays: deque[tuple[float, float]] = deque()

    def on_arrival(
        self, stamp_s: float, wall_s: float, now_s: float, clock: RobotClock = REAL_CLOCK
    ) -> float:
        """Return the age in seconds; 0 for a picture without a stamp (0).

        `wall_s` is the time of day, `now_s` the monotonic clock, `clock` the robot's.
        """
        if stamp_s <= 0.0 or clock.simulated:
            return 0.0
        delay_s = wall_s - stamp_s
        while self._delays and self._delays[-1][1] >= delay_s:
            self._delays.pop()
        self._delays.append((now_s, delay_s))
        while self._delays[0][0] < now_s - WINDOW_S:
            self._delays.popleft()
        smallest_s = self._delays[0][1]
        if clock.skew_s is not None and smallest_s + clock.skew_s < OTHER_CLOCK_S:
            smallest_s = min(smallest_s, -clock.skew_s)
        return delay_s if 0.0 <= smallest_s <= CLOCK_SKEW_S else delay_s - smallest_s
