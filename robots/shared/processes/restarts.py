"""When a process that ended is started again: soon, then later and later.

All times are arguments: seconds of one monotonic clock.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class RestartBudget:
    """Pauses before a program that ended is started again, in seconds."""

    first_s: float = 0.5
    longest_s: float = 8.0
    falls: int = 6
    window_s: float = 60.0
    rest_s: float = 60.0
    _fallen_at: list[float] = field(default_factory=list)

    def wait_s(self, now_s: float) -> float:
        """Return the pause (s) after an end at `now_s`.

        The pause doubles each time; it is `rest_s` after more than `falls` ends within `window_s`.
        """
        self._fallen_at = [at for at in self._fallen_at if now_s - at < self.window_s] + [now_s]
        if len(self._fallen_at) > self.falls:
            return self.rest_s
        return float(min(self.first_s * 2 ** (len(self._fallen_at) - 1), self.longest_s))
