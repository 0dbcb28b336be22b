"""The largest part of a wanted twist that is safe among known points (GATE.md, methods 1-5).

Pure: everything is an argument, nothing is kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate import arc, braking
from robots.bridge.gate.arc import Courses, Metres, Rows
from robots.bridge.gate.footprint import Footprint, clearances
from robots.bridge.gate.planar import Points, chosen
from robots.bridge.gate.values import GateProfile, Velocity

WAY_OUT_M = 0.0001  # a point is never asked to be farther away than it is, less this
STANDING_MPS = 0.01  # slower than this is standing: the last centimetre would take for ever
TURN_TOLERANCE_RADPS = 0.1  # a turn rate this near to the one asked for bends the arc by 2 cm in 1 m at most
TURN_SHARES = (1.0, 0.7, 0.4)  # tried in this order when rotation is given back
NOTHING = 1e-6  # m/s or rad/s
_WHOLE = 0.999

OBSTACLE = "obstacle"
NEAR_MISS = "near_miss"


class Share(NamedTuple):
    """How much of a twist is safe, by which rule, and for which point (its row; -1 if nothing limits)."""

    share: float
    rule: str = ""
    row: int = -1


FREE = Share(1.0)


class Cause(NamedTuple):
    """The point that limits a twist, and by which rule. `source` as in `Obstacles`."""

    rule: str
    point: tuple[float, float]
    gap_m: float
    source: int


class Restraint(NamedTuple):
    """The safe twist, and what takes the rest away."""

    velocity: Velocity
    cause: Cause | None = None


def restrain(
    wanted: Velocity,
    turn_rates: tuple[float, ...],
    points: Points,
    source: NDArray[np.intp],
    footprint: Footprint,
    profile: GateProfile,
) -> Restraint:
    """The safe part of `wanted`.

    `turn_rates` are those the base has or is about to have (rad/s): until it turns as wanted it follows
    their arcs at the wanted speed, so these must be clear too.
    """
    followed = (wanted._replace(w=w) for w in _differing(turn_rates, wanted.w))
    arcs = (wanted, *(twist for twist in followed if any(twist)))
    near = _within_reach(points, arcs, footprint, profile)
    if not len(near):
        return Restraint(wanted)
    points = chosen(points, near)
    gaps = footprint.gaps(points)
    growth = way_out(gaps, profile.parameters.lateral_margin_m, footprint.demanded_share)
    surroundings = (points, gaps, growth, footprint, profile)
    shares = safe_shares(arcs, *surroundings)
    limit = min((shares[twist] for twist in arcs), key=_by_share)
    if limit is FREE:
        return Restraint(wanted)
    row = limit.row
    point = float(points[row, 0]), float(points[row, 1])
    cause = Cause(limit.rule, point, float(gaps[row]), int(source[near[row]]))
    return Restraint(_give_rotation_back(wanted, limit.share, *surroundings), cause)


def way_out(gaps: Metres, lateral_margin_m: float, demanded_share: float) -> Metres:
    """How far the hull is grown: by the lateral margin, but never demand more clearance than there is.

    Beside a wall the margin shrinks for all points alike, else the wall's next metre would hold the robot; it
    does not shrink below the hull itself, except for points that are inside already: only then it is not the same
    for all points, (1,), but each has its own, (N,).
    """
    spare = np.minimum(gaps, demanded_share * gaps) - WAY_OUT_M
    least = float(spare.min(initial=lateral_margin_m))
    return np.array([least]) if least >= 0.0 else np.minimum(spare, 0.0)


def safe_shares(
    twists: Sequence[Velocity],
    points: Points,
    gaps: Metres,
    growth: Metres,
    footprint: Footprint,
    profile: GateProfile,
) -> dict[Velocity, Share]:
    """The share of each twist that braking and passing allow: the smaller one. The twists differ in their turn only."""
    shares: dict[Velocity, Share] = {}
    for courses in arc.courses(points, twists):
        brakes = _braking_shares(courses, growth, footprint, profile)
        passes = _passing_shares(courses, points, gaps, growth, footprint, profile)
        for twist, *limits in zip(courses.twists, brakes, passes, strict=True):
            shares[twist] = min(limits, key=_by_share)
    return shares


def _by_share(limit: Share) -> float:
    return limit.share


def _braking_shares(
    courses: Courses, growth: Metres, footprint: Footprint, profile: GateProfile
) -> list[Share]:
    """Braking ends before contact, with the front margin left along the path (methods 1 and 2)."""
    parameters = profile.parameters
    contacts = footprint.contacts(courses, growth)
    until_s = contacts.times - parameters.front_margin_m / contacts.speeds
    shares = []
    for twist, first in zip(
        courses.twists, _lowest(until_s, contacts.twists, len(courses.twists)), strict=True
    ):
        if first is None:
            shares.append(FREE)
            continue
        braking_s = braking.braking_time(twist, profile)
        share = braking.scale(float(until_s[first]), parameters.latency_s, braking_s)
        shares.append(Share(share, OBSTACLE, int(contacts.rows[first])) if share < 1.0 else FREE)
    return shares


def _passing_shares(
    courses: Courses,
    points: Points,
    gaps: Metres,
    growth: Metres,
    footprint: Footprint,
    profile: GateProfile,
) -> list[Share]:
    """Passing close by is slow (method 3): v <= v_creep + (clearance - m_lat) / c_lat where the hull is nearest.

    Before that place the robot may be as fast as still lets it brake to this speed; the gap shrinks at most as
    fast as the robot moves, so gap - clearance is a distance that is surely left.
    """
    free = [FREE] * len(courses.twists)
    way = courses.twists[0]
    v = arc.speed(way)
    parameters = profile.parameters
    if v <= parameters.creep_mps:
        return free
    x, y = points.T
    harmless = parameters.lateral_margin_m + (v - parameters.creep_mps) * parameters.near_miss_s
    ahead = way.vx * x + way.vy * y > 0.0
    clear = clearances(courses, footprint)
    numbers, rows = arc.places((clear < harmless) & (clear >= growth) & ahead)
    if not len(rows):
        return free
    clear = clear[numbers, rows]
    spare = np.maximum(clear - parameters.lateral_margin_m, 0.0)
    there = parameters.creep_mps + spare / parameters.near_miss_s
    left = np.maximum(gaps[rows] - clear, 0.0)
    linear, _ = braking.deceleration(profile)
    allowed = braking.speed_before(left, there, parameters.latency_s, linear)
    return [
        FREE
        if slowest is None or allowed[slowest] >= v
        else Share(float(allowed[slowest]) / v, NEAR_MISS, int(rows[slowest]))
        for slowest in _lowest(allowed, numbers, len(free))
    ]


def _lowest(values: Metres, numbers: Rows, count: int) -> list[int | None]:
    """Where the lowest value of each twist is, None if it has none. Values come in order of their twists' numbers."""
    ends = np.searchsorted(numbers, np.arange(count + 1)).tolist()
    return [start + int(values[start:end].argmin()) if start < end else None for start, end in pairwise(ends)]


def _give_rotation_back(
    wanted: Velocity,
    share: float,
    points: Points,
    gaps: Metres,
    growth: Metres,
    footprint: Footprint,
    profile: GateProfile,
) -> Velocity:
    """The scaled twist with the largest safe part of the wanted turn (method 5).

    So, nose at the wall and the stick held diagonally, the robot still turns.
    """
    scaled = Velocity(*(share * axis + 0.0 for axis in wanted))
    if arc.speed(scaled) < STANDING_MPS:
        scaled = Velocity(0.0, 0.0, scaled.w)
    if wanted.w == 0.0:
        return scaled
    candidates = [scaled._replace(w=turn * wanted.w) for turn in TURN_SHARES if turn > share]
    shares = safe_shares(candidates, points, gaps, growth, footprint, profile)
    return next((twist for twist in candidates if shares[twist].share > _WHOLE), scaled)


def _differing(turn_rates: tuple[float, ...], w: float) -> list[float]:
    """The turn rates that make another arc than `w` does, each once."""
    differing: list[float] = []
    for rate in turn_rates:
        if all(abs(rate - known) > TURN_TOLERANCE_RADPS for known in (w, *differing)):
            differing.append(rate)
    return differing


def _within_reach(
    points: Points, arcs: tuple[Velocity, ...], footprint: Footprint, profile: GateProfile
) -> NDArray[np.intp]:
    """Indices of the points that the hull could touch before it has braked."""
    parameters = profile.parameters
    way = max(arc.speed(twist) * braking.horizon(twist, profile) for twist in arcs)
    reach = footprint.reach(parameters.lateral_margin_m) + parameters.front_margin_m + way
    x, y = points.T
    return np.flatnonzero(x * x + y * y < reach**2)


def is_still(twist: Velocity) -> bool:
    """Whether the twist asks for nothing at all."""
    return twist.vx == 0.0 and twist.vy == 0.0 and twist.w == 0.0


def clamped(asked: Velocity, profile: GateProfile) -> Velocity:
    """The twist within what the robot can do, axis by axis; what is next to nothing becomes zero."""
    limits = profile.limits
    within = (
        min(max(asked.vx, -limits.reverse_mps), limits.forward_mps),
        min(max(asked.vy, -limits.lateral_mps), limits.lateral_mps),
        min(max(asked.w, -limits.turn_radps), limits.turn_radps),
    )
    return Velocity(*(axis if abs(axis) > NOTHING else 0.0 for axis in within))


def is_finite(twist: Velocity) -> bool:
    """Whether all three numbers are numbers."""
    return all(math.isfinite(axis) for axis in twist)
