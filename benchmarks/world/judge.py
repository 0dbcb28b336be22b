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
from robots.bridge.gate.values import STILL, Limits, Parameters, Velocity

FREE_M = 2.0  # of free way, in which the asked speed is expected
FALSE_STOP = 0.3  # below this share of the reachable motion, a turn on the spot included
REACHABLE = 0.3  # of the asked twist; before that, nothing is judged
LEAST_MPS, LEAST_RADPS = 0.05, 0.3  # of the asked twist
STANDS_MPS, STANDS_RADPS = 0.02, 0.05
LEAST_WAY_M = 0.3  # with less to go, nobody is stuck
EVERY = 4  # of the decisions are judged
REVERSE_MPS = Parameters().between_sonars_mps  # no stick gets more where sonars alone look


class Keeping(NamedTuple):
    """Share of the stick that was left to the operator: sums over the moments that count."""

    wide: int = 0  # moments with `FREE_M` free
    wide_share: float = 0.0  # sum of published / reachable in them
    back: int = 0  # of them, those in reverse, and their share of the sum
    back_share: float = 0.0
    given_share: float = 0.0  # the same, of no more than `REVERSE_MPS`
    free: int = 0  # moments in which the way to stop in is free
    false_stops: int = 0
    tried: int = 0  # moments in which the stick asked for something
    stuck: int = 0  # of them, the robot stood and was held though there was a free way, or only a turn
    stopped_by: Counter[str] = Counter()  # causes of the false stops, by what the gate said
    stuck_by: Counter[str] = Counter()

    @property
    def lost_percent(self) -> float:
        """Lost share of the reachable speed with free space around, percent."""
        return 100.0 * (1.0 - self.wide_share / self.wide) if self.wide else math.nan

    @property
    def lost_ahead_percent(self) -> float:
        """The same forward and turning."""
        return Keeping(self.wide - self.back, self.wide_share - self.back_share).lost_percent

    @property
    def lost_back_percent(self) -> float:
        """In reverse, of `REVERSE_MPS`."""
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
    """The sums of all."""
    return Keeping(*(reduce(operator.add, column) for column in zip(Keeping(), *parts, strict=True)))


def kept(trace: Trace, truth: Truth, limits: Limits) -> Keeping:
    """Published against reachable speed, wherever the true way is free.

    Reachable is the share of the asked twist that a base with these limits can have been brought to: from what was
    published before the way became free, at its own accelerations.
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
    """Return whether a standing robot is held though it could go a little way, or turn as it is asked to."""
    moves = abs(moment.moving.vx) > STANDS_MPS or abs(moment.moving.w) > STANDS_RADPS
    if moves or moment.sent != STILL:
        return False
    asked = moment.asked
    if abs(asked.w) >= LEAST_RADPS:  # nothing is in the way of a disc that turns
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
    """One period nearer to what is asked."""
    linear, angular = limits.linear_mps2 * PERIOD_S, limits.angular_radps2 * PERIOD_S
    return Velocity(
        min(max(asked.vx, reached.vx - linear), reached.vx + linear),
        0.0,
        min(max(asked.w, reached.w - angular), reached.w + angular),
    )


def _share(given: Velocity, asked: Velocity) -> float:
    """Return how much of the asked twist this is: of its speed, or of its turning where nothing else is asked."""
    return given.vx / asked.vx if asked.vx else given.w / asked.w if asked.w else 0.0


def motion_mps(twist: Velocity) -> float:
    """Return the speed of the fastest point of the hull. A robot that turns as it is asked to has not stopped."""
    return math.hypot(twist.vx, twist.vy) + RADIUS_M * abs(twist.w)


def _is_worth_judging(asked: Velocity) -> bool:
    return abs(asked.vx) >= LEAST_MPS or (not asked.vx and abs(asked.w) >= LEAST_RADPS)


def _needed_m(asked: Velocity, limits: Limits) -> float:
    """The way in which anybody would stop from the asked speed, with half a second to react and 0.2 m to spare."""
    return min(abs(asked.vx) * 0.5 + asked.vx**2 / (2.0 * 0.6 * limits.linear_mps2) + 0.2, FREE_M)
