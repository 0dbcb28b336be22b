"""Measure the time until the robot's computer acknowledges sent bytes, without its clock.

An acknowledgement may have come at any moment between two checks, so the result is the shortest possible
time.
"""

from __future__ import annotations

import math
from collections import deque

MOST = 1000  # writes that are not acknowledged; a connection's buffer is full earlier


class RoundTrips:
    """One connection. Bytes are counted from its beginning."""

    def __init__(self) -> None:
        # writes without acknowledgement: total bytes at the end of each, and its time
        self._unacknowledged: deque[tuple[int, float]] = deque(maxlen=MOST)
        self._looked_s = -math.inf
        self._last_s = math.inf

    def wrote(self, total: int, now_s: float) -> None:
        """Take the total of bytes that are written now."""
        self._unacknowledged.append((total, now_s))

    def took_s(self, acknowledged: int, now_s: float) -> float | None:
        """Return the time (s) until an acknowledgement; None: nothing new. `acknowledged`: total bytes."""
        newest_s = None
        while self._unacknowledged and self._unacknowledged[0][0] <= acknowledged:
            newest_s = self._unacknowledged.popleft()[1]
        looked_s, self._looked_s = self._looked_s, now_s
        if newest_s is not None:
            self._last_s = max(looked_s - newest_s, 0.0)
            return self._last_s
        waits_s = now_s - self._unacknowledged[0][1] if self._unacknowledged else 0.0
        return waits_s if waits_s > self._last_s else None
