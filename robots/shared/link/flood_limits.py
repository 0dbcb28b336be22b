"""Limits the messages, or the cost, of one connection. Pure: time is an argument."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class TokenBucket:
    """A token bucket of `size`, filled by `rate_per_s`; each message takes one token, or its cost."""

    rate_per_s: float
    size: float
    _left: float = field(init=False)
    _at_s: float = field(init=False, default=float("-inf"))

    def __post_init__(self) -> None:
        self._left = self.size

    def spend(self, now_s: float, cost: float = 1.0) -> bool:
        """Take `cost` tokens. Return False and take none if there are too few."""
        self._fill(now_s)
        if self._left < cost:
            return False
        self._left -= cost
        return True

    def left(self, now_s: float) -> float:
        """Return the tokens that are left."""
        self._fill(now_s)
        return self._left

    def wait_s(self, now_s: float) -> float:
        """Return the seconds until a token is available."""
        self._fill(now_s)
        return max(1.0 - self._left, 0.0) / self.rate_per_s

    def is_full(self, now_s: float) -> bool:
        """Return whether the bucket is full, so that it need not be kept."""
        self._fill(now_s)
        return self._left >= self.size

    def _fill(self, now_s: float) -> None:
        self._left = min(self.size, self._left + (now_s - self._at_s) * self.rate_per_s)
        self._at_s = now_s
