"""Judge a trace: false stops, stuck time, lost speed."""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Iterable
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

from benchmarks.world.loop import PERIOD_S, Moment, Trace
from benchmarks.world.truth import RADIUS_M, Truth
from robots.shared.configuration.gate_profile import Limits, Parameters
from robots.shared.geometry.poses import STILL, Velocity

FREE_M = 2.0  # free way with which the asked speed is expected
FALSE_STOP = 0.3  # below this share of the reachable motion, also of a turn on the spot
REACHABLE = 0.3  # share of the asked twist: below it, nothing is judged
LEAST_MPS, LEAST_RADPS = 0.05, 0.3  # of the asked twist
STANDS_MPS, STANDS_RADPS = 0.02, 0.05
LEAST_WAY_M = 0.3  # with less free way, a robot at rest does not count as stuck
EVERY = 4  # of the decisions are judged
REVERSE_MPS = Parameters().between_sonars_mps  # most speed in directions that only sonars measure


class Keeping(NamedTuple):
    """How much of the asked motion was left to the operator: sums over the moments that count."""

    wide: int = 0  # moments with `FREE_M` free
    wide_share: float = 0.0  # sum of published / reachable in these moments
    back: int = 0  # number of these moments in reverse
    back_share: float = 0.0  # their part of the sum
    given_share: float = 0.0  # the same, with reachable limited to `REVERSE_MPS`
    free: int = 0  # moments in which the stopping distance is free
    false_stops: int = 0
    tried: int = 0  # moments in which the stick asked for motion
    # of `tried`: the robot stood and was held although the way was free, or only a turn was asked
    stuck: int = 0
    stopped_by: Counter[str] = Counter()  # causes of the false stops, by the gate's text
    stuck_by: Counter[str] = Counter()

    @property
    def lost_percent(self) -> float:
        """Lost part of the reachable speed with `FREE_M` free, in percent."""
        return 100.0 * (1.0 - self.wide_share / self.wide) if self.wide else math.nan

    @property
    def lost_ahead_percent(self) -> float:
        """The same for forward motion and turns."""
        return Keeping(self.wide - self.back, self.wide_share - self.back_share).lost_percent

    @property
    def lost_back_percent(self) -> float:
        """The same in reverse, relative to at most `REVERSE_MPS`."""
        return Keeping(self.back, self.given_share).lost_percent

    @property
    def false_stop_percent(self) -> float:
        """False stops, percent of the moments with a free way."""
        return 100.0 * self.false_stops / self.free if self.free else math.nan

    @property
    def stuck_percent(self) -> float:
        """Stuck time, percent of the time in which the stick asks for motion."""
        return 100.0 * self.stuck / self.tried if self.tried else math.nan


def together(parts: Iterable[Keeping]) -> Keeping:
    """Return the sums of all parts."""
    return Keeping(*(reduce(operator.add, column) for column in zip(Keeping(), *parts, strict=True)))


def kept(trace: Trace, truth: Truth, limits: Limits) -> Keeping:
    """Compare published and reachable speed wherever the true way is free, and return the sums.

    Reachable is the share of the asked twist that a base with these limits could have reached: it starts with
    the twist published before the way became free, and accelerates at the base's limits.
    """
    moments: list[Keeping] = []
    reached, was_free = STILL, False
    for number, (before, moment) in enumerate(pairwise(trace.moments)):
        asked = moment.asked
        if number % EVERY == 0 and moment.trying and _is_worth_judging(asked):
            stuck = is_stuck(moment, truth, limits)
            moments.append(Keeping(tried=1, stuck=int(stuck), stuck_by=_causes(moment, stuck)))
        reached = _stepped(reached if was_free else before.sent, asked, limits)
        if number % EVERY and was_free:
            continue
        free_m = truth.free_m(moment.pose, asked, FREE_M)
        was_free = free_m >= _needed_m(asked, limits)
        reachable = min(_share(reached, asked), reached.w / asked.w if asked.w else 1.0)  # the arc is kept
        if not moment.trying or not was_free or reachable < REACHABLE or not _is_worth_judging(asked):
            continue
        share = _share(moment.sent, asked) / reachable
        stopped = motion_mps(moment.sent) < FALSE_STOP * reachable * motion_mps(asked)
        one = Keeping(free=1, false_stops=int(stopped), stopped_by=_causes(moment, stopped))
        if free_m >= FREE_M:
            one = one._replace(wide=1, wide_share=min(share, 1.0))
        if free_m >= FREE_M and asked.vx < 0.0:
            given = min(reachable, REVERSE_MPS / -asked.vx)
            one = one._replace(
                back=1, back_share=min(share, 1.0), given_share=min(share * reachable / given, 1.0)
            )
        moments.append(one)
    return together(moments)


def is_stuck(moment: Moment, truth: Truth, limits: Limits) -> bool:
    """Return whether a standing robot is held although it could drive a little way, or do the asked turn."""
    moves = abs(moment.moving.vx) > STANDS_MPS or abs(moment.moving.w) > STANDS_RADPS
    if moves or moment.sent != STILL:
        return False
    asked = moment.asked
    if abs(asked.w) >= LEAST_RADPS:  # a disc that turns on the spot meets no obstacle
        return True
    needed_m = max(_needed_m(asked, limits), LEAST_WAY_M)
    return truth.free_m(moment.pose, asked, FREE_M, from_near=True) >= needed_m


def _causes(moment: Moment, counts: bool) -> Counter[str]:
    """Return the gate's reason without figures, and the direction of the stick; empty if the moment does not count."""
    if not counts:
        return Counter()
    said = re.sub(r", [\d.]+ m .*| \(.*\)|[\d.]+ ", "", moment.text.partition(": ")[2] or moment.text)
    way = "reverse" if moment.asked.vx < 0.0 else "forward" if moment.asked.vx > 0.0 else "turn"
    return Counter([f"{way}: {said or 'nothing said'}"])


def _stepped(reached: Velocity, asked: Velocity, limits: Limits) -> Velocity:
    """Return the velocity one period later, accelerated towards the asked velocity."""
    linear, angular = limits.linear_mps2 * PERIOD_S, limits.angular_radps2 * PERIOD_S
    return Velocity(
        min(max(asked.vx, reached.vx - linear), reached.vx + linear),
        0.0,
        min(max(asked.w, reached.w - angular), reached.w + angular),
    )


def _share(given: Velocity, asked: Velocity) -> float:
    """Return the given part of the asked speed; of the asked turn, if only a turn is asked."""
    return given.vx / asked.vx if asked.vx else given.w / asked.w if asked.w else 0.0


def motion_mps(twist: Velocity) -> float:
    """Return the speed of the hull's fastest point, m/s: a robot that turns on the spot has not stopped."""
    return math.hypot(twist.vx, twist.vy) + RADIUS_M * abs(twist.w)


def _is_worth_judging(asked: Velocity) -> bool:
    return abs(asked.vx) >= LEAST_MPS or (not asked.vx and abs(asked.w) >= LEAST_RADPS)


def _needed_m(asked: Velocity, limits: Limits) -> float:
    """Return the stopping distance from the asked speed, with 0.5 s of reaction and 0.2 m to spare."""
    return min(abs(asked.vx) * 0.5 + asked.vx**2 / (2.0 * 0.6 * limits.linear_mps2) + 0.2, FREE_M)
