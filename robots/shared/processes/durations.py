"""Counts durations by length; quick enough to count every command."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import accumulate

BOUNDS_S = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3)


class Durations:
    """A histogram. `counts[n]` is the number of durations up to `BOUNDS_S[n]` and above the bound before it.

    The last number counts the durations above all bounds.
    """

    __slots__ = ("counts", "sum_s")

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS_S) + 1)
        self.sum_s = 0.0

    def add(self, seconds: float) -> None:
        self.counts[bisect_left(BOUNDS_S, seconds)] += 1
        self.sum_s += seconds


def buckets(counts: Sequence[int]) -> list[tuple[str, float]]:
    """Return `Durations.counts` in the form of Prometheus: for each bound, the number of durations up to it."""
    bounds = [*(f"{bound:g}" for bound in BOUNDS_S), "+Inf"]
    return list(zip(bounds, map(float, accumulate(counts)), strict=True))
