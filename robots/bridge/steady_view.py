"""Steady words for people: the gate decides anew twenty times a second, and noise changes its words as often.

Only the words wait: the robot gets each decision at once. Stricter words are shown at once, milder ones only if the
stricter ones have not come again for a while. So nobody reads that the robot may drive while it may not.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from robots.bridge.gate import words
from robots.shared.geometry.arc import speed
from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import SpeedLimit, Verdict

STANDS_S = 2.0  # the words are held for this time if the robot may hardly move
DRIVES_S = 0.5  # ... and for this time if it may
# Below these speeds, noise of a few millimetres stops the robot and frees it
CRAWLS_MPS, CRAWLS_RADPS = 0.05, 0.1
LIMITS_S = 1.0  # a speed limit is shown for this time after its end
# Verdicts of other rules, and of silent sensors, change seldom. They are shown as they come.
PASSING = frozenset(
    {
        "free",
        "robot_limit",
        "depth_missing",
        "depth_stale",
        "head_away",
        "blind_direction",
        "sonar_stale",
        "arm_away",
        "robot_late",
        "operator_late",
        "camera_late",
        "scan_late",
        "obstacle",
        "near_miss",
        "mover",
    }
)


class _Told(NamedTuple):
    """A verdict with its time, and how strict it is: larger is stricter."""

    at_s: float
    strict: tuple[int, float, float]
    verdict: Verdict


class SteadyVerdict:
    """The verdict as people read it."""

    def __init__(self) -> None:
        self._lately: deque[_Told] = deque()
        self._shown: _Told | None = None

    def observe(self, verdict: Verdict, now_s: float) -> None:
        """Take the newest verdict."""
        newest = _Told(now_s, _strict(verdict), verdict)
        shown = self._shown
        if shown is None or not _may_wait(shown.verdict, verdict):
            self._lately.clear()
        self._lately.append(newest)
        hold_s = STANDS_S if _hardly_moves(verdict) else DRIVES_S
        while now_s - self._lately[0].at_s > hold_s:
            self._lately.popleft()
        strictest = max(told.strict for told in self._lately)
        if shown is not None and shown.strict == strictest and self._comes_again(shown.verdict):
            return
        self._shown = next(told for told in reversed(self._lately) if told.strict == strictest)

    def _comes_again(self, verdict: Verdict) -> bool:
        return any(_about(told.verdict) == _about(verdict) for told in self._lately)

    @property
    def shown(self) -> Verdict | None:
        """The verdict to show: the newest twists with the words that are held. None: there is none yet."""
        if self._shown is None:
            return None
        held, newest = self._shown.verdict, self._lately[-1].verdict
        point = newest.point if _about(newest) == _about(held) else None  # the robot drives past it
        return held._replace(velocity=newest.velocity, asked=newest.asked, point=point)


class SteadyLimits:
    """Speed limits as people read them. A limit that comes and goes (a sensor's age at its limit) stays."""

    def __init__(self) -> None:
        self._shown: dict[tuple[str, str | None], tuple[float, float, SpeedLimit]] = {}

    def of(self, limits: Sequence[SpeedLimit], now_s: float) -> list[SpeedLimit]:
        """Return the limits to show, by the newest `limits`."""
        for limit in limits:
            key = limit.code, limit.way
            _, changed_s, shown = self._shown.get(key, (now_s, -math.inf, limit))
            if limit.mps < shown.mps or now_s - changed_s >= LIMITS_S:
                shown, changed_s = limit, now_s
            self._shown[key] = now_s, changed_s, shown
        self._shown = {key: kept for key, kept in self._shown.items() if now_s - kept[0] < LIMITS_S}
        return [shown for _, _, shown in self._shown.values()]


def _may_wait(shown: Verdict, verdict: Verdict) -> bool:
    """Return whether the words of `shown` may stay for a moment: the same is asked, and the gate answers."""
    same_way = _signs(shown.asked) == _signs(verdict.asked)
    return same_way and {shown.code, verdict.code} <= PASSING and not (shown.neutral or verdict.neutral)


def _signs(asked: Velocity) -> tuple[float, ...]:
    """Return the way that is asked: forward or reverse, left or right; for a turn on the spot, its sense."""
    ways = (asked.vx, asked.vy) if speed(asked) else (asked.w,)
    return tuple(math.copysign(1.0, axis) if axis else 0.0 for axis in ways)


def _about(verdict: Verdict) -> tuple[str, str | None, str | None, str | None]:
    return verdict.code, verdict.sensor, verdict.side, verdict.way


def _hardly_moves(verdict: Verdict) -> bool:
    """Return whether the robot gets hardly any of the motion that is asked."""
    if speed(verdict.asked):
        return speed(verdict.velocity) < CRAWLS_MPS
    return abs(verdict.velocity.w) < CRAWLS_RADPS


def _strict(verdict: Verdict) -> tuple[int, float, float]:
    """Return how strict a verdict is: standing, turning only, slowed, free; then by the figures in its words."""
    drives, turns = speed(verdict.velocity), abs(verdict.velocity.w)
    if not verdict.text:
        return 0, 0.0, 0.0
    moves = 1 if drives or not speed(verdict.asked) else 2
    kind = moves if drives or turns else 3
    gap_m = math.inf if verdict.distance_m is None else verdict.distance_m
    return kind, -float(words.fine(drives or turns)), -_as_read(gap_m)


def _as_read(gap_m: float) -> float:
    return gap_m if math.isinf(gap_m) else float(words.fine(max(gap_m, 0.0)))
