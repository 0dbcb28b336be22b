"""What is made of a trace."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from benchmarks.world.loop import PERIOD_S, Moment, Trace
from benchmarks.world.truth import Truth
from robots.bridge.gate.values import Limits, Velocity

FREE_M = 2.0  # of free way, in which the asked speed is expected
FALSE_STOP = 0.3  # below this share of the reachable speed
REACHABLE_MPS = 0.1  # below this, nothing is judged
REACHABLE_RADPS = 0.3
EVERY = 4  # of the decisions are judged


class Keeping(NamedTuple):
    """How much of the stick was left to the operator: sums over the moments that count."""

    wide: int = 0  # moments with `FREE_M` free
    wide_share: float = 0.0  # sum of published / reachable in them
    free: int = 0  # moments in which the way to stop in is free
    false_stops: int = 0

    @property
    def lost_percent(self) -> float:
        """Of the reachable speed, in the wide."""
        return 100.0 * (1.0 - self.wide_share / self.wide) if self.wide else math.nan

    @property
    def false_stop_percent(self) -> float:
        """Of the moments in which the way is free."""
        return 100.0 * self.false_stops / self.free if self.free else math.nan


def together(parts: Iterable[Keeping]) -> Keeping:
    """The sums of all."""
    return Keeping(*(sum(column) for column in zip(Keeping(), *parts, strict=True)))


def kept(trace: Trace, truth: Truth, limits: Limits) -> Keeping:
    """Published against reachable speed, wherever the true way is free.

    Reachable is what a base with these limits could have been sent: from what was published before the way became
    free, at its own acceleration.
    """
    moments: list[Keeping] = []
    reachable, was_free = 0.0, False
    before: Moment | None = None
    for number, moment in enumerate(trace.moments):
        asked, got, acceleration, least = _axis(moment, limits)
        from_ = reachable if was_free else (_axis(before, limits)[1] if before else 0.0)
        if before is None or math.copysign(1.0, before.asked.vx) != math.copysign(1.0, moment.asked.vx):
            from_ = 0.0
        step = acceleration * PERIOD_S
        reachable = min(max(asked, from_ - step), from_ + step)
        before = moment
        if number % EVERY and was_free:
            continue
        free_m = truth.free_m(moment.pose, moment.asked, FREE_M)
        was_free = free_m >= _needed_m(moment.asked, limits)
        if not moment.trying or not was_free or reachable < least:
            continue
        share = got / reachable
        wide = free_m >= FREE_M
        moments.append(Keeping(int(wide), min(share, 1.0) if wide else 0.0, 1, int(share < FALSE_STOP)))
    return together(moments)


def _axis(moment: Moment, limits: Limits) -> tuple[float, float, float, float]:
    """Asked and published speed, acceleration and least speed of note: of turning where nothing else is asked."""
    if moment.asked.vx:
        sign = math.copysign(1.0, moment.asked.vx)
        return abs(moment.asked.vx), sign * moment.sent.vx, limits.linear_mps2, REACHABLE_MPS
    sign = math.copysign(1.0, moment.asked.w)
    return abs(moment.asked.w), sign * moment.sent.w, limits.angular_radps2, REACHABLE_RADPS


def _needed_m(asked: Velocity, limits: Limits) -> float:
    """The way in which anybody would stop from the asked speed, with half a second to react and 0.2 m to spare."""
    return min(abs(asked.vx) * 0.5 + asked.vx**2 / (2.0 * 0.6 * limits.linear_mps2) + 0.2, FREE_M)
