"""Estimate how long the battery will last, from the rate of its discharge. Pure: time is an argument."""

from __future__ import annotations

from collections import deque

WINDOW_S = 1800.0  # only this time counts: the robot's present work, not the work of the morning
STEP_S = 15.0  # between two samples that are kept
LEAST_S = 300.0  # after a shorter time, a number would be a guess
LEAST_FALL = 1.0  # percent: many robots report whole percents
JUMP = 5.0  # percent between two samples: another battery, or a wrong number
LONGEST_MIN = 24 * 60


class BatteryTime:
    """The last half hour of one battery."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque()  # time, percent

    def observe(self, percent: float, charging: bool | None, now_s: float) -> None:
        """Take the charge in percent. While the battery is charging nothing is estimated."""
        if charging:
            self._samples.clear()
            return
        if self._samples:
            last_s, last = self._samples[-1]
            if abs(percent - last) > JUMP or percent > self._samples[0][1] + LEAST_FALL:
                self._samples.clear()
            elif now_s - last_s < STEP_S:
                return
        self._samples.append((now_s, percent))
        while now_s - self._samples[0][0] > WINDOW_S:
            self._samples.popleft()

    def left_min(self) -> int | None:
        """Return the minutes until the battery is empty, by the last half hour; None: not known yet.

        Rounded down: to 5 minutes below one hour, to 15 minutes below three hours, else to 30 minutes.
        """
        if len(self._samples) < 2:
            return None
        (first_s, first), (last_s, last) = self._samples[0], self._samples[-1]
        if last_s - first_s < LEAST_S or first - last < LEAST_FALL:
            return None
        minutes = last / (first - last) * (last_s - first_s) / 60.0
        grain = 5 if minutes < 60 else 15 if minutes < 180 else 30
        return min(int(minutes // grain) * grain, LONGEST_MIN)
