"""Age of the camera picture by which the holder of control drives, as the holder's page reports it.

A page that reports no more has an older and older picture: its last report ages with it.
"""

from __future__ import annotations

import time

NOTICED_S = 0.5  # from this age on, the bridge is told of changes at once


class CameraViewAge:
    """The reports of one page."""

    def __init__(self) -> None:
        self._taken_s: float | None = None  # monotonic clock; None: the page does not drive by a camera
        self._was_old = False

    def age_s(self) -> float | None:
        """Return the picture's age now in seconds; None: the page does not drive by a camera."""
        return None if self._taken_s is None else max(time.monotonic() - self._taken_s, 0.0)

    def take(self, age_ms: float | None) -> bool:
        """Take a report. Return whether the picture became old, or new again."""
        self._taken_s = None if age_ms is None else time.monotonic() - age_ms / 1000.0
        was_old, self._was_old = self._was_old, age_ms is not None and age_ms >= 1000.0 * NOTICED_S
        return was_old != self._was_old
