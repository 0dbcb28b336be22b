"""Compute the largest part of a wanted twist that is safe among known points (docs/gate.md, 1-5).

The functions are pure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry import arc
from robots.bridge.gate.geometry.arc import Courses, Growth, Metres, Rows, Way
from robots.bridge.gate.geometry.footprint import Footprint, clearances
from robots.bridge.gate.geometry.planar import Points, chosen
from robots.bridge.gate.motion import braking
from robots.bridge.gate.values import GateProfile, Parameters, Velocity

WAY_OUT_M = 0.0001  # the demanded clearance is smaller than the real one by at least this
STANDING_MPS = 0.01  # a slower robot counts as standing: otherwise the last centimetre would take very long
TURN_TOLERANCE_RADPS = 0.1  # turn rates that differ by less count as one arc: at 1 m/s, 5 cm apart after 1 m
TURN_SHARES = (1.0, 0.7, 0.4)  # of the wanted turn, tried in this order when rotation is given back
GUESSES = 2  # number of points that are kept because they may forbid the next turn, too
NOTHING = 1e-6  # m/s or rad/s
_WHOLE = 0.999
_SURELY_NOT_WHOLE = 0.998  # the distance to `_WHOLE` is much larger than rounding errors

OBSTACLE = "obstacle"
NEAR_MISS = "near_miss"


class Share(NamedTuple):
    """Safe share of a twist, the rule that limits it, and the row of the limiting point (-1 if nothing limits)."""

    share: float
    rule: str = ""
    row: int = -1


FREE = Share(1.0)


class Cause(NamedTuple):
    """The point that limits a twist, and the rule. `source` as in `Obstacles`."""

    rule: str
    point: tuple[float, float]
    gap_m: float
    source: int


class Surroundings(NamedTuple):
    """The points for the check of twists that have the same direction and speed, and different turn rates.

    `points` are seen along the direction `way`. `gaps`: their distances from the hull. `growth`: how far the
    hull is grown for them.
    """

    points: Points
    way: Way
    gaps: Metres
    growth: Growth
    footprint: Footprint
    profile: GateProfile

    def growth_of(self, rows: Rows) -> Growth:
        """Return how far the hull is grown for some of the points."""
        return self.growth if isinstance(self.growth, float) else self.growth.take(rows)


class Restraint(NamedTuple):
    """The safe twist, and the cause of its reduction.

    `guesses`: rows of the points that forbade turns, the newest first. Mostly they forbid the next turn, too.
    """

    velocity: Velocity
    cause: Cause | None = None
    guesses: tuple[int, ...] = ()


def restrain(
    wanted: Velocity,
    turn_rates: tuple[float, ...],
    points: Points,
    source: NDArray[np.intp],
    footprint: Footprint,
    profile: GateProfile,
    expected: float = 1.0,
    guesses: Sequence[int] = (),
) -> Restraint:
    """Return the safe part of `wanted`.

    `turn_rates` (rad/s): the base has them now or soon. Until it turns as wanted, it follows their arcs at
    the wanted speed, so these arcs must be clear, too. `expected` and `guesses` (of the last decision) change
    only the computing time: if the safe share is smaller than `expected`, only the points near enough for
    such a share are checked.
    """
    followed = (wanted._replace(w=w) for w in _differing(turn_rates, wanted.w))
    arcs = (wanted, *(twist for twist in followed if any(twist)))
    x, y = points.T
    squares = x * x + y * y
    way = arc.way(wanted)
    for share in (expected, 1.0) if expected < 1.0 else (1.0,):
        near: Rows = (squares < _reach(share, arcs, footprint, profile) ** 2).nonzero()[0]
        if not len(near):
            continue
        some = chosen(points, near) if len(near) < len(points) else points
        gaps = footprint.gaps(some)
        growth = way_out(gaps, profile.parameters.lateral_margin_m, footprint.demanded_share)
        surroundings = Surroundings(arc.seen_along(some, way), way, gaps, growth, footprint, profile)
        limit = _limit(arcs, surroundings)
        if limit.share < share:
            row = limit.row
            point = float(some[row, 0]), float(some[row, 1])
            cause = Cause(limit.rule, point, float(gaps[row]), int(source[near[row]]))
            places = [(int(near.searchsorted(guess)), guess) for guess in guesses]
            known = [place for place, guess in places if place < len(near) and near[place] == guess]
            given, rows = _give_rotation_back(wanted, limit, known, surroundings)
            return Restraint(given, cause, tuple(int(near[row]) for row in rows[:GUESSES]))
    return Restraint(wanted)


def way_out(gaps: Metres, lateral_margin_m: float, demanded_share: float) -> Growth:
    """Return how far the hull is grown (m): by the lateral margin, but at most by the present clearance.

    Beside a wall the growth is reduced equally for all points; otherwise the next metre of the wall would
    stop the robot. If a point is inside the hull already, each point has its own growth: negative for the
    points inside, zero for the others.
    """
    narrowest = float(np.minimum.reduce(gaps, initial=math.inf))
    least = min(narrowest - WAY_OUT_M, demanded_share * narrowest - WAY_OUT_M, lateral_margin_m)
    if least >= 0.0:
        return least
    return np.minimum(np.minimum(gaps, demanded_share * gaps) - WAY_OUT_M, 0.0)


def _limit(arcs: Sequence[Velocity], surroundings: Surroundings) -> Share:
    """Return the largest share at which all of these twists are safe."""
    courses = arc.courses(surroundings.points, surroundings.way, arcs)
    limit = min(_braking_shares(arcs, courses, surroundings), key=_by_share)
    passed = _passed(arcs[0], surroundings, limit.share)
    if len(passed):
        limit = min(limit, _passing_share(arcs, courses, passed, surroundings, limit.share), key=_by_share)
    return limit


def _first_whole(
    twists: Sequence[Velocity], rows: list[int], surroundings: Surroundings
) -> tuple[Velocity | None, list[int]]:
    """Return the first of these twists that is completely safe (None: none is), and `rows` in a new order.

    The twists differ only in their turn rates. `rows` are points that may forbid a turn, the likeliest first.
    A point that forbids one turn mostly forbids the others, too, and a check of one point is quick. In the
    returned rows the points that did forbid a turn come first.
    """
    for twist in twists:
        met = next((row for row in rows if _is_stopped_by(row, twist, surroundings)), -1)
        if met < 0:
            courses = arc.courses(surroundings.points, surroundings.way, [twist])
            (braked,) = _braking_shares([twist], courses, surroundings)
            if braked.share > _WHOLE and _passes(twist, courses, surroundings):
                return twist, rows
            met = braked.row
        if met >= 0:
            rows = [met, *(row for row in rows if row != met)]
    return None, rows


def _passes(twist: Velocity, courses: Courses, surroundings: Surroundings) -> bool:
    """Return whether no near miss slows the twist of these courses."""
    passed = _passed(twist, surroundings, 1.0)
    return not len(passed) or _passing_share([twist], courses, passed, surroundings, 1.0).share > _WHOLE


def _is_stopped_by(row: int, twist: Velocity, surroundings: Surroundings) -> bool:
    """Return whether this point alone surely makes the complete twist unsafe; False in doubt."""
    profile, growth = surroundings.profile, surroundings.growth
    if not isinstance(growth, float):
        return False
    x, y = surroundings.points[row].tolist()
    until_s = surroundings.footprint.meets_s(
        x, y, surroundings.way, twist, growth, profile.parameters.front_margin_m
    )
    share = braking.scale(until_s, profile.parameters.latency_s, braking.braking_time(twist, profile))
    return share < _SURELY_NOT_WHOLE


def _by_share(limit: Share) -> float:
    return limit.share


def _braking_shares(twists: Sequence[Velocity], courses: Courses, surroundings: Surroundings) -> list[Share]:
    """Return the share of each twist whose braking ends m_front before contact (methods 1 and 2)."""
    profile = surroundings.profile
    margin_m, latency_s = profile.parameters.front_margin_m, profile.parameters.latency_s
    contacts = surroundings.footprint.contacts(courses, surroundings.growth, margin_m)
    shares = [
        braking.scale(contact.until_s, latency_s, braking.braking_time(twist, profile))
        for twist, contact in zip(twists, contacts, strict=True)
    ]
    return [
        Share(share, OBSTACLE, contact.row) if share < 1.0 else FREE
        for share, contact in zip(shares, contacts, strict=True)
    ]


def _passed(twist: Velocity, surroundings: Surroundings, below: float) -> Rows:
    """Return the rows of points ahead that may make `_passing_share` smaller than `below` on some arc.

    The other points are so far away that at the share `below` the robot need not slow down for them yet.
    """
    v = below * arc.speed(twist)
    parameters = surroundings.profile.parameters
    if v <= parameters.creep_mps:
        return np.empty(0, dtype=np.intp)
    linear, _ = braking.deceleration(surroundings.profile)
    slowing_m = braking.way_between(v, parameters.creep_mps, parameters.latency_s, linear)
    near = surroundings.gaps < slowing_m + harmless_m(v, parameters)
    return (near & (surroundings.points[:, 0] > 0.0)).nonzero()[0]


def harmless_m(v: float, parameters: Parameters) -> float:
    """Return the clearance (m) at which a near miss allows this speed (m/s)."""
    return parameters.lateral_margin_m + (v - parameters.creep_mps) * parameters.near_miss_s


def _passing_share(
    twists: Sequence[Velocity], courses: Courses, passed: Rows, surroundings: Surroundings, below: float
) -> Share:
    """Return the largest share at which every arc passes the `passed` points slowly enough (method 3).

    Where the hull is nearest to a point: v <= v_creep + (clearance - m_lat) / c_lat. Before that place the
    robot may be faster, if it can still brake to this speed: the gap shrinks at most as fast as the robot
    moves, so at least the distance gap - clearance is left. A share that is not smaller than `below` may be
    returned as 1.
    """
    parameters, footprint = surroundings.profile.parameters, surroundings.footprint
    each = [
        clearances(courses.track(number, passed), twist, footprint) for number, twist in enumerate(twists)
    ]
    clear: Metres = np.array(each)
    growth = surroundings.growth_of(passed)
    near = ((clear < harmless_m(below * courses.v, parameters)) & (clear >= growth)).ravel().nonzero()[0]
    if not len(near):
        return FREE
    clear, rows = clear.take(near), passed.take(near % len(passed))
    spare = np.maximum(clear - parameters.lateral_margin_m, 0.0)
    there = parameters.creep_mps + spare / parameters.near_miss_s
    left = np.maximum(surroundings.gaps.take(rows) - clear, 0.0)
    linear, _ = braking.deceleration(surroundings.profile)
    allowed = braking.speed_before(left, there, parameters.latency_s, linear)
    slowest = int(allowed.argmin())
    share = float(allowed[slowest]) / courses.v
    return Share(share, NEAR_MISS, int(rows[slowest])) if share < 1.0 else FREE


def _give_rotation_back(
    wanted: Velocity, limit: Share, guesses: list[int], surroundings: Surroundings
) -> tuple[Velocity, list[int]]:
    """Return the scaled twist with the largest safe part of the wanted turn (method 5), and the next guesses.

    So a robot with its nose at a wall still turns while the stick is held diagonally.
    """
    scaled = wanted.scaled(limit.share)
    if arc.speed(scaled) < STANDING_MPS:
        scaled = Velocity(0.0, 0.0, scaled.w)
    if wanted.w == 0.0:
        return scaled, guesses
    candidates = [
        Velocity(scaled.vx, scaled.vy, turn * wanted.w) for turn in TURN_SHARES if turn > limit.share
    ]
    turned, rows = _first_whole(candidates, [*guesses, limit.row], surroundings)
    return turned or scaled, rows


def _differing(turn_rates: tuple[float, ...], w: float) -> list[float]:
    """Return the turn rates whose arcs differ from the arc of `w`, without duplicates."""
    differing: list[float] = []
    for rate in turn_rates:
        if all(abs(rate - known) > TURN_TOLERANCE_RADPS for known in (w, *differing)):
            differing.append(rate)
    return differing


def _reach(share: float, arcs: Sequence[Velocity], footprint: Footprint, profile: GateProfile) -> float:
    """Return the distance from the base origin beyond which no point makes this `share` of the twists unsafe.

    Braking: before a contact, the base can move at least the point's distance minus the grown hull and
    m_front. If this is `share` times the stopping way of the whole twist or more, at least `share` is safe.
    Passing: see `_passed`. A point beyond this distance changes neither the growth (`way_out`) nor the
    rotation that is given back.
    """
    parameters = profile.parameters
    widest = max(arcs, key=_turning)  # it takes the longest to brake
    v = arc.speed(widest)
    lateral_m = parameters.lateral_margin_m
    braking_m = footprint.reach(lateral_m) + parameters.front_margin_m
    stopping_m = v * braking.horizon(widest, profile)
    whole_m = braking_m + stopping_m
    if share == 1.0:
        return whole_m
    braking_m += share * stopping_m
    linear, _ = braking.deceleration(profile)
    slower = share * v
    passing_m = slower * (parameters.latency_s + slower / (2.0 * linear) + parameters.near_miss_s) + lateral_m
    growing_m = (lateral_m + WAY_OUT_M) / footprint.demanded_share
    return min(whole_m, max(braking_m, footprint.reach(max(passing_m, growing_m))))


def _turning(twist: Velocity) -> float:
    return abs(twist.w)


def is_still(twist: Velocity) -> bool:
    """Return whether the twist is exactly zero."""
    return twist.vx == 0.0 and twist.vy == 0.0 and twist.w == 0.0


def clamped(asked: Velocity, profile: GateProfile) -> Velocity:
    """Return the twist limited to the robot's limits, each axis separately; tiny values become zero."""
    limits = profile.limits
    within = (
        min(max(asked.vx, -limits.reverse_mps), limits.forward_mps),
        min(max(asked.vy, -limits.lateral_mps), limits.lateral_mps),
        min(max(asked.w, -limits.turn_radps), limits.turn_radps),
    )
    return Velocity(*(axis if abs(axis) > NOTHING else 0.0 for axis in within))


def is_finite(twist: Velocity) -> bool:
    """Return whether all three numbers are finite."""
    return all(math.isfinite(axis) for axis in twist)
