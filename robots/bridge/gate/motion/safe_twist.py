"""Compute the largest part of a wanted twist that is safe near the known points (docs/gate.md, 1-5).

The functions are pure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.motion import braking
from robots.shared.configuration.gate_profile import GateProfile, Parameters
from robots.shared.geometry import arc
from robots.shared.geometry.arc import Courses, Direction, Metres, OneOrEach, Rows
from robots.shared.geometry.footprint import Footprint, clearances
from robots.shared.geometry.planar import Points, chosen
from robots.shared.geometry.poses import Velocity

# The gate asks for this much less room than the robot has now, so the robot can always drive out.
ROOM_LEFT_M = 0.0001
STANDING_MPS = 0.01  # a slower robot counts as standing: otherwise the last centimetre would take very long
TURN_TOLERANCE_RADPS = 0.1  # turn rates that differ by less count as one arc: at 1 m/s, 5 cm apart after 1 m
TURN_SHARES = (1.0, 0.7, 0.4)  # parts of the wanted turn, tried in this order after the speed was reduced
GUESSES = 2  # points to remember: they blocked this turn and will probably block the next
NOTHING = 1e-6  # m/s or rad/s; less counts as zero
_WHOLE = 0.999  # a larger share counts as the whole twist
_SURELY_NOT_WHOLE = 0.998  # smaller than `_WHOLE` by much more than a rounding error

OBSTACLE = "obstacle"
NEAR_MISS = "near_miss"


class Share(NamedTuple):
    """Safe share of a twist, the rule that limits it, and the row of the limiting point (-1 if nothing limits)."""

    share: float
    rule: str = ""
    row: int = -1


FREE = Share(1.0)


class Cause(NamedTuple):
    """The point that limits a twist, and the rule. `source` as in `Obstacles`; `mps`: speed of a mover."""

    rule: str
    point: tuple[float, float]
    gap_m: float
    source: int
    mps: float = 0.0


class Surroundings(NamedTuple):
    """The points for the check of twists that have the same direction and speed, and different turn rates.

    `points`: in coordinates that are turned so that x is the `direction` of travel. `gaps`: their distances
    from the hull. `hull_growth`: how much larger the hull is made for them, metres.
    """

    points: Points
    direction: Direction
    gaps: Metres
    hull_growth: OneOrEach
    footprint: Footprint
    profile: GateProfile

    def hull_growth_of(self, rows: Rows) -> OneOrEach:
        """Return the hull growth for some of the points."""
        return self.hull_growth if isinstance(self.hull_growth, float) else self.hull_growth.take(rows)


class Restraint(NamedTuple):
    """The safe twist, and the cause of its reduction.

    `guesses`: rows of the points that blocked turns, the newest first. They will probably block the next turn.
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

    `turn_rates` (rad/s): those that the base has now, or was told to have. Until the base turns as wanted, it
    follows their arcs at the wanted speed, so these arcs must be clear, too.

    `expected` (a share) and `guesses` come from the last decision. They only save computing time; the result
    is the same. The points that are near enough to matter for the expected share are checked first. Other
    points are checked only if the safe share is not smaller than expected.
    """
    followed = (wanted._replace(w=w) for w in _differing(turn_rates, wanted.w))
    arcs = (wanted, *(twist for twist in followed if any(twist)))
    x, y = points.T
    squares = x * x + y * y
    direction = arc.direction_of(wanted)
    for share in (expected, 1.0) if expected < 1.0 else (1.0,):
        near: Rows = (squares < _reach(share, arcs, footprint, profile) ** 2).nonzero()[0]
        if not len(near):
            continue
        some = chosen(points, near) if len(near) < len(points) else points
        gaps = footprint.gaps(some)
        hull_growth = allowed_margin(gaps, profile.parameters.lateral_margin_m, footprint.demanded_share)
        surroundings = Surroundings(
            arc.seen_along(some, direction), direction, gaps, hull_growth, footprint, profile
        )
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


def allowed_margin(gaps: Metres, margin_m: float, demanded_share: float) -> OneOrEach:
    """Return the distance (m) to keep: the margin, but never more than the free room (method 4).

    All points use the same value; otherwise the robot would stop at each new metre of a wall. Only if a point
    is inside the hull already, each point has its own value: negative for points inside, zero for the others.
    """
    narrowest = float(np.minimum.reduce(gaps, initial=math.inf))
    least = min(narrowest - ROOM_LEFT_M, demanded_share * narrowest - ROOM_LEFT_M, margin_m)
    if least >= 0.0:
        return least
    return np.minimum(np.minimum(gaps, demanded_share * gaps) - ROOM_LEFT_M, 0.0)


def _limit(arcs: Sequence[Velocity], surroundings: Surroundings) -> Share:
    """Return the largest share at which all of these twists are safe."""
    courses = arc.courses(surroundings.points, surroundings.direction, arcs)
    limit = min(_braking_shares(arcs, courses, surroundings), key=_by_share)
    passed = _passed(arcs[0], surroundings, limit.share)
    if len(passed):
        limit = min(limit, _passing_share(arcs, courses, passed, surroundings, limit.share), key=_by_share)
    return limit


def _first_whole(
    twists: Sequence[Velocity], rows: list[int], surroundings: Surroundings
) -> tuple[Velocity | None, list[int]]:
    """Return the first of these twists that is completely safe (None: none is), and `rows` in a new order.

    The twists differ only in their turn rates. `rows` are points that may block a turn, the most probable
    first. A point that blocks one turn mostly blocks the others, too, and a check of one point is quick. In
    the returned rows, the points that did block a turn come first.
    """
    for twist in twists:
        met = next((row for row in rows if _is_stopped_by(row, twist, surroundings)), -1)
        if met < 0:
            courses = arc.courses(surroundings.points, surroundings.direction, [twist])
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
    profile, hull_growth = surroundings.profile, surroundings.hull_growth
    if not isinstance(hull_growth, float):
        return False
    x, y = surroundings.points[row].tolist()
    until_s = surroundings.footprint.meets_s(
        x, y, surroundings.direction, twist, hull_growth, profile.parameters.front_margin_m
    )
    share = braking.scale(until_s, profile.parameters.latency_s, braking.braking_time(twist, profile))
    return share < _SURELY_NOT_WHOLE


def _by_share(limit: Share) -> float:
    return limit.share


def _braking_shares(twists: Sequence[Velocity], courses: Courses, surroundings: Surroundings) -> list[Share]:
    """Return each twist's largest share that stops m_front before contact with a point (methods 1 and 2)."""
    profile = surroundings.profile
    margin_m, latency_s = profile.parameters.front_margin_m, profile.parameters.latency_s
    contacts = surroundings.footprint.contacts(courses, surroundings.hull_growth, margin_m)
    shares = [
        braking.scale(contact.until_s, latency_s, braking.braking_time(twist, profile))
        for twist, contact in zip(twists, contacts, strict=True)
    ]
    return [
        Share(share, OBSTACLE, contact.row) if share < 1.0 else FREE
        for share, contact in zip(shares, contacts, strict=True)
    ]


def _passed(twist: Velocity, surroundings: Surroundings, below: float) -> Rows:
    """Return the rows of the points ahead that could reduce the share below `below`.

    All others are too far away: at this share, the robot need not slow down for them yet.
    """
    v = below * arc.speed(twist)
    parameters = surroundings.profile.parameters
    if v <= parameters.creep_mps:
        return np.empty(0, dtype=np.intp)
    linear, _ = braking.deceleration(surroundings.profile)
    slowing_m = braking.slowing_distance(v, parameters.creep_mps, parameters.latency_s, linear)
    near = surroundings.gaps < slowing_m + harmless_m(v, parameters)
    return (near & (surroundings.points[:, 0] > 0.0)).nonzero()[0]


def harmless_m(v: float, parameters: Parameters) -> float:
    """Return the clearance (m) with which the robot may pass a point at the speed `v` (m/s)."""
    return parameters.lateral_margin_m + (v - parameters.creep_mps) * parameters.near_miss_s


def _passing_share(
    twists: Sequence[Velocity], courses: Courses, passed: Rows, surroundings: Surroundings, below: float
) -> Share:
    """Return the largest share at which every arc passes the `passed` points slowly enough (method 3).

    Where the hull is nearest to a point: v <= v_creep + (clearance - m_lat) / c_lat. Farther from the point
    the robot may be faster, if it can brake in time. For this it has at least the distance gap - clearance,
    because the gap becomes smaller at most as fast as the robot moves. A share that is not smaller than
    `below` may be returned as 1.
    """
    parameters, footprint = surroundings.profile.parameters, surroundings.footprint
    each = [
        clearances(courses.track(number, passed), twist, footprint) for number, twist in enumerate(twists)
    ]
    clear: Metres = np.array(each)
    hull_growth = surroundings.hull_growth_of(passed)
    near = ((clear < harmless_m(below * courses.v, parameters)) & (clear >= hull_growth)).ravel().nonzero()[0]
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

    So a robot that stands directly before a wall still turns while the stick is held diagonally.
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
    """Return a distance (m) from the base origin. A point farther than this cannot change the result.

    It cannot make this `share` of the twists unsafe. Braking: before a contact, the base can move at least
    the point's distance minus the radius of the grown hull and m_front. At this share, the base stops within
    `share` times the stopping distance of the whole twist, or less. Passing: see `_passed`. Such a point
    changes neither the hull growth (`allowed_margin`) nor the turn that is given back.
    """
    parameters = profile.parameters
    widest = max(arcs, key=lambda arc: abs(arc.w))  # it takes the longest to brake
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
    growing_m = (lateral_m + ROOM_LEFT_M) / footprint.demanded_share
    return min(whole_m, max(braking_m, footprint.reach(max(passing_m, growing_m))))


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
