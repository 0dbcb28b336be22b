"""How much one connection may say, or cost. Pure: time is an argument."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Budget:
    """A bucket of `size` tokens that fills by `rate_per_s`; each message takes one, or what it costs."""

    rate_per_s: float
    size: float
    _left: float = field(init=False)
    _at_s: float = field(init=False, default=float("-inf"))

    def __post_init__(self) -> None:
        self._left = self.size

    def spend(self, now_s: float, cost: float = 1.0) -> bool:
        """Take so many tokens. False, and none is taken, if there are not so many."""
        self._fill(now_s)
        if self._left < cost:
            return False
        self._left -= cost
        return True

    def wait_s(self, now_s: float) -> float:
        """How long until there is a token."""
        self._fill(now_s)
        return max(1.0 - self._left, 0.0) / self.rate_per_s

    def is_full(self, now_s: float) -> bool:
        """Whether nothing was spent for so long that it need not be kept."""
        self._fill(now_s)
        return self._left >= self.size

    def _fill(self, now_s: float) -> None:
        self._left = min(self.size, self._left + (now_s - self._at_s) * self.rate_per_s)
        self._at_s = now_s
