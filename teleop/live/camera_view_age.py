"""Age of the camera picture by which the holder of control drives, as the holder's page reports it.

If the page stops reporting, the age of its last report grows with time.
"""

from __future__ import annotations

import math
import time

NOTICED_S = 0.5  # from this age on, changes are sent to the bridge at once
STEP_S = 0.2  # smallest change of the age that is sent again
OLDEST_S = 5.0  # at this age the speed limit has its lowest value


class CameraViewAge:
    """The reports of one page."""

    def __init__(self) -> None:
        self._taken_s: float | None = None  # monotonic clock; None: the page does not drive by a camera
        self._sent_step = 0  # the age that was sent last, in steps beyond `NOTICED_S`

    def age_s(self) -> float | None:
        """Return the picture's age now in seconds; None: the page does not drive by a camera."""
        return None if self._taken_s is None else max(time.monotonic() - self._taken_s, 0.0)

    def observe(self, age_ms: float | None) -> bool:
        """Store a report. Return whether the age has changed so much that it must be sent to the bridge at once."""
        self._taken_s = None if age_ms is None else time.monotonic() - age_ms / 1000.0
        before, self._sent_step = self._sent_step, _steps((age_ms or 0.0) / 1000.0)
        return before != self._sent_step


def _steps(age_s: float) -> int:
    return math.ceil((min(age_s, OLDEST_S) - NOTICED_S) / STEP_S) if age_s > NOTICED_S else 0
