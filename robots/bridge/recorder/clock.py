"""The clock of one recording: it starts by the computer's time of day, and never jumps."""

from __future__ import annotations

import time

JUMP_S = 0.5  # a larger difference is noted in the file


class RecordingClock:
    """Tells the time in a file for a moment of the monotonic clock, also after the time of day was set."""

    def __init__(self, wall_ns: int | None = None, monotonic_ns: int | None = None) -> None:
        self._wall_ns = time.time_ns() if wall_ns is None else wall_ns
        self._monotonic_ns = time.monotonic_ns() if monotonic_ns is None else monotonic_ns
        self._noted_ns = 0

    def log_ns(self, monotonic_ns: int) -> int:
        """Return the time in the file, in nanoseconds since 1970."""
        return max(0, self._wall_ns + monotonic_ns - self._monotonic_ns)

    def jump_s(self, wall_ns: int, monotonic_ns: int) -> float | None:
        """Return by how much the time of day is ahead of the file's, once after each jump."""
        ahead_ns = wall_ns - self.log_ns(monotonic_ns)
        if abs(ahead_ns - self._noted_ns) < JUMP_S * 1e9:
            return None
        self._noted_ns = ahead_ns
        return ahead_ns / 1e9
