"""Roll-out: check pose by pose whether the robot can stop without contact after a twist (docs/gate.md, 6).

Only a base without rate limits would follow the arcs of methods 1 to 5 exactly. A real base still executes
earlier commands, and its speeds change at limited rates, which bends the arc. So the roll-out computes
("plays") the motion: the commands that are sent and not obeyed yet, one period of the candidate, then full
braking. The functions are pure.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.motion import braking
from robots.bridge.gate.motion.safe_twist import STANDING_MPS, allowed_margin
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry import arc
from robots.shared.geometry.arc import Metres, OneOrEach, Rows
from robots.shared.geometry.footprint import Footprint, Spread
from robots.shared.geometry.planar import Drift, Path, Points, chosen
from robots.shared.geometry.poses import Pose, Velocity

MOVER_MARGIN_M = 0.10  # margin of moving points, instead of m_hard: their future place is uncertain
RESTS_S = 0.4  # the robot stands this long before a mover may be there: people turn and start within a step
SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25, 0.1, 0.0)  # of the candidate; the largest clear share is taken
PIECE_S = 0.05  # longest time step in which queued commands are played
MOST_POSES = 60  # largest number of poses of one braking
REMEMBERED_S = 1.0  # commands are kept for this time, which is longer than any assumed latency
LONGEST_STEP_S = 0.1  # a longer pause does not allow a larger step
_EXACT_M = 0.0001  # more than the rounding error of the gaps: a roll-out computes them in 32 bits


class Sent(NamedTuple):
    """A command that was published this long ago."""

    velocity: Velocity
    age_s: float


class Rolled(NamedTuple):
    """Share of a candidate that may be sent, and the row of the point that limits it (-1: no point does)."""

    share: float
    row: int = -1


class _State(NamedTuple):
    """State of the base at one moment of the roll-out."""

    x: float
    y: float
    yaw: float
    time_s: float
    velocity: Velocity


class _Rates(NamedTuple):
    """Rates at which speeds may change: m/s^2 and rad/s^2, away from zero and towards it."""

    linear_up: float
    linear_down: float
    angular_up: float
    angular_down: float


CLEAR = Rolled(1.0)


class Commands:
    """Recently published twists, as far as the gate knows them."""

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Velocity]] = deque()

    def add(self, velocity: Velocity, now_s: float) -> None:
        """Store the newest command. A repeated command keeps the time at which it was first sent."""
        if not self._sent or self._sent[-1][1] != velocity:
            self._sent.append((now_s, velocity))
        while len(self._sent) > 1 and now_s - self._sent[1][0] > REMEMBERED_S:
            self._sent.popleft()

    def lately(self, now_s: float, latency_s: float) -> list[Sent]:
        """Return the command in effect, if known, and all later commands, oldest first."""
        queue: list[Sent] = []
        for sent_s, velocity in reversed(self._sent):
            age_s = now_s - sent_s
            queue.append(Sent(velocity, age_s))
            if age_s >= latency_s:
                break
        queue.reverse()
        return queue


def safe_share(
    candidate: Velocity,
    queue: Sequence[Sent],
    velocity: Velocity,
    points: Points,
    drift: Drift | None,
    footprint: Footprint,
    profile: GateProfile,
    period_s: float,
    latency_s: float,
) -> Rolled:
    """Return the largest of `SHARES` of `candidate` after which the robot can brake clear of all points.

    `queue`: the recent commands, oldest first. The newest command that is older than `latency_s` is assumed
    to be in effect. `velocity`: the measured velocity. `drift`: how each point moves (None: all points stand);
    moving points get a wider margin. The gate never demands more distance to a point than the
    robot would keep if it braked now (method 4).
    """
    if _only_turns_a_disc(candidate, queue, velocity, footprint):
        return CLEAR
    rates = _rates(profile)
    onset = _played(queue, velocity, rates, latency_s)
    whole = _moved(onset[-1], candidate, rates, period_s)
    if drift is None:
        met = _near(points, onset, whole, rates, footprint, profile, period_s)
        if not len(met):
            return CLEAR
        first = _stopped([whole], rates, footprint, onset)
    else:
        first = _rested(_stopped([whole], rates, footprint, onset))
        met = _within(points, drift, first, footprint)
        if not len(met):
            return CLEAR
    points = chosen(points, met)
    drift = None if drift is None else drift.chosen(met)
    margins = _margins(len(met), drift, profile)
    spare = footprint.least_gaps(first, points, drift)[0] - margins
    if np.minimum.reduce(spare) >= 0.0:
        return CLEAR
    worst = int(met[spare.argmin()])
    onward = [whole, *(_moved(onset[-1], candidate.scaled(share), rates, period_s) for share in SHARES[1:])]
    distinct = list(dict.fromkeys(onward))
    paths, braking_row = _stopped(distinct, rates, footprint), distinct.index(onward[-1])
    if drift is not None:
        paths = _rested(paths)
    after = footprint.least_gaps(paths, points, drift)
    stopping = after[braking_row]
    onset_gaps = footprint.least_gaps(_path(onset), points, drift)[0]
    demanded = _demanded(np.minimum(onset_gaps, stopping), drift, profile, footprint)
    clear = after - demanded >= 0.0
    meets_movers = False
    if drift is not None:
        met_braking = (drift.moves & (stopping < 0.0) & (onset_gaps >= 0.0)).nonzero()[0]
        meets_movers = len(met_braking) > 0
        if meets_movers:
            drives_until_s = np.array([_drives_until_s(state, rates) for state in distinct])
            moving = drift.chosen(met_braking)
            clear[:, met_braking] = _met_no_worse(
                paths, drives_until_s, braking_row, points[met_braking], moving, footprint
            )
    in_time = bool((stopping >= margins).all())
    is_clear = {state: bool(row.all()) for state, row in zip(distinct, clear, strict=True)}
    share = _largest_clear(onward, is_clear, in_time, meets_movers)
    return CLEAR if share == 1.0 else Rolled(share, worst)


def _largest_clear(
    onward: Sequence[_State], is_clear: Mapping[_State, bool], in_time: bool, meets_movers: bool
) -> float:
    """Return the largest share whose path is clear.

    If even braking now ends too near (not `in_time`), a share that brakes as hard as share 0 in this calculation is not
    tried: the real base may brake harder than assumed, but only if zero is sent.
    """
    for share, state in zip(SHARES, onward, strict=True):
        tried = in_time or not _brakes_as_hard(state, onward[-1], whatever_turn=meets_movers)
        if tried and is_clear[state]:
            return share
    return 0.0


def _brakes_as_hard(state: _State, braking: _State, *, whatever_turn: bool) -> bool:
    """Return whether the base is no faster than if it brakes; `whatever_turn`: and it does not only turn."""
    if state == braking:
        return True
    return whatever_turn and any(braking.velocity[:2]) and state.velocity[:2] == braking.velocity[:2]


def stepped_up(sent: Velocity, wanted: Velocity, profile: GateProfile, dt_s: float) -> Velocity:
    """Return `wanted`, but with no speed raised from `sent` faster than the base can follow in `dt_s`.

    A speed is lowered at once. Each axis is limited separately, as in the base. So the base can follow the
    twists that are sent, and the roll-out computes its real motion.
    """
    limits = profile.limits
    linear, angular = limits.linear_mps2 * dt_s, limits.angular_radps2 * dt_s
    return Velocity(
        _raised(sent.vx, wanted.vx, linear),
        _raised(sent.vy, wanted.vy, linear),
        _raised(sent.w, wanted.w, angular),
    )


def _raised(sent: float, wanted: float, step: float) -> float:
    same_way = sent * wanted > 0.0
    most = (abs(sent) if same_way else 0.0) + step
    return wanted if abs(wanted) <= most else math.copysign(most, wanted)


def _only_turns_a_disc(
    candidate: Velocity, queue: Sequence[Sent], velocity: Velocity, footprint: Footprint
) -> bool:
    """Return whether the hull is a disc, and it only turns or stands, now and by commands and candidate."""
    if not footprint.turns_freely:
        return False
    twists = (candidate, velocity, *(sent.velocity for sent in queue))
    return all(arc.speed(twist) < STANDING_MPS for twist in twists)


def _rates(profile: GateProfile) -> _Rates:
    """Return the rates of a base that speeds up at its full rate and brakes at the usable deceleration."""
    linear, angular = braking.deceleration(profile)
    return _Rates(profile.limits.linear_mps2, linear, profile.limits.angular_radps2, angular)


# --- computing the motion -------------------------------------------------------------------------


def _played(queue: Sequence[Sent], velocity: Velocity, rates: _Rates, latency_s: float) -> list[_State]:
    """Return the states of the base from now until all sent commands have taken effect."""
    states = [_State(0.0, 0.0, 0.0, 0.0, velocity)]
    obeyed = velocity
    for sent in queue:
        _obey(obeyed, max(latency_s - sent.age_s, 0.0), states, rates)
        obeyed = sent.velocity
    _obey(obeyed, latency_s, states, rates)
    return states


def _obey(command: Velocity, until_s: float, states: list[_State], rates: _Rates) -> None:
    """Append the states under one command until a moment, in short time steps."""
    state = states[-1]
    left_s = until_s - state[3]
    if left_s <= 0.0:
        return
    pieces = math.ceil(left_s / PIECE_S - 1e-9)
    for _ in range(pieces):
        state = _moved(state, command, rates, left_s / pieces)
        states.append(state)


def _moved(state: _State, command: Velocity, rates: _Rates, span_s: float) -> _State:
    """Return the state of the base a short time later; its speeds change evenly in this time."""
    x, y, yaw, time_s, before = state
    vx_after, vy_after, w_after = after = (
        before if before == command else _followed_up(before, command, rates, span_s)
    )
    vx, vy, w = before
    half = span_s / 2.0
    forward, turned = half * (vx + vx_after), half * (w + w_after)
    heading = yaw + turned / 2.0
    cos, sin = math.cos(heading), math.sin(heading)
    x += cos * forward
    y += sin * forward
    if vy or vy_after:
        left = half * (vy + vy_after)
        x -= sin * left
        y += cos * left
    return _State(x, y, yaw + turned, time_s + span_s, after)


def _followed_up(before: Velocity, command: Velocity, rates: _Rates, span_s: float) -> Velocity:
    """Return the speeds a short time later, changed towards the commanded speeds."""
    vx, vy, w = before
    vx_asked, vy_asked, w_asked = command
    linear_up, linear_down, angular_up, angular_down = rates
    return Velocity(
        vx if vx == vx_asked else _changed(vx, vx_asked, linear_up * span_s, linear_down * span_s),
        vy if vy == vy_asked else _changed(vy, vy_asked, linear_up * span_s, linear_down * span_s),
        w if w == w_asked else _changed(w, w_asked, angular_up * span_s, angular_down * span_s),
    )


def _changed(speed: float, command: float, up: float, down: float) -> float:
    """Return a speed changed towards the command: by at most `up` away from zero, `down` towards zero."""
    if command > speed:
        reached = speed + (up if speed >= 0.0 else down)
        return reached if reached < command else command
    reached = speed - (up if speed <= 0.0 else down)
    return reached if reached > command else command


def _stopped(
    begun: Sequence[_State], rates: _Rates, footprint: Footprint, lead: Sequence[_State] = ()
) -> Path:
    """Return a row of poses for each state of `begun`: the states `lead`, then full braking to the end."""
    xs, ys, yaws, times_s, velocities = zip(*begun, strict=True)
    vxs, vys, ws = zip(*velocities, strict=True)
    poses = max([_poses_until_still(velocity, rates, footprint) for velocity in velocities])
    path = np.empty((4, len(begun), len(lead) + poses + 1))
    if lead:
        path[:, :, : len(lead)] = np.array([state[:4] for state in lead]).T[:, None]
    x, y, yaw, time_s = _column(xs), _column(ys), _column(yaws), _column(times_s)
    still_s = _column([_still_s(velocity, rates) for velocity in velocities])
    passed_s = still_s * _evenly_along_a_braked_path(poses)
    forward, turned = _braked(passed_s, vxs, rates.linear_down), _braked(passed_s, ws, rates.angular_down)
    heading = yaw + (turned[:, 1:] + turned[:, :-1]) / 2.0
    cos, sin, ahead = np.cos(heading), np.sin(heading), forward[:, 1:] - forward[:, :-1]
    places, steps = path[:2, :, len(lead) :], np.empty((2, *passed_s.shape))
    steps[0, :, :1], steps[1, :, :1] = x, y
    np.multiply(ahead, cos, out=steps[0, :, 1:])
    np.multiply(ahead, sin, out=steps[1, :, 1:])
    if any(vys):
        left = _braked(passed_s, vys, rates.linear_down)
        aside = left[:, 1:] - left[:, :-1]
        steps[0, :, 1:] -= aside * sin
        steps[1, :, 1:] += aside * cos
    np.add.accumulate(steps, axis=2, out=places)
    np.add(yaw, turned, out=path[2, :, len(lead) :])
    np.add(time_s, passed_s, out=path[3, :, len(lead) :])
    return Path(*path)


def _braked(passed_s: Metres, speeds: Sequence[float], rate: float) -> Metres:
    """Return the distance that each speed has covered at the times `passed_s` of braking, one row each."""
    ends_s = _column([abs(speed) / rate for speed in speeds])
    half = _column([math.copysign(rate / 2.0, speed) for speed in speeds])
    braked_s = np.minimum(passed_s, ends_s)
    distance: Metres = braked_s * (_column(speeds) - half * braked_s)
    return distance


def _rested(path: Path) -> Path:
    """Return the path with a rest at its end."""
    x, y, yaw, time_s = (np.concatenate((axis, axis[:, -1:]), axis=1) for axis in path)
    time_s[:, -1] += RESTS_S
    return Path(x, y, yaw, time_s)


def _column(numbers: Sequence[float]) -> Metres | float:
    """Return a column of numbers, one for each row; a single number stays a float: an array is slower."""
    return numbers[0] if len(numbers) == 1 else np.array(numbers)[:, None]


def _still_s(velocity: Velocity, rates: _Rates) -> float:
    """Return how long full braking takes."""
    vx, vy, w = map(abs, velocity)
    return max(max(vx, vy) / rates.linear_down, w / rates.angular_down)


def _drives_until_s(state: _State, rates: _Rates) -> float:
    """Return when a base that brakes fully no longer drives, although it may still turn."""
    vx, vy, _ = map(abs, state.velocity)
    return state.time_s + max(vx, vy) / rates.linear_down


def _poses_until_still(velocity: Velocity, rates: _Rates, footprint: Footprint) -> int:
    """Return how many poses a braking needs so that they are close together, at most `MOST_POSES`."""
    vx, vy, w = map(abs, velocity)
    still_s = _still_s(velocity, rates)
    swing_m = 0.0 if footprint.turns_freely else footprint.reach(0.0)
    return min(math.ceil((vx + vy + swing_m * w) * still_s / 2.0 / footprint.pose_spacing_m) + 1, MOST_POSES)


@cache
def _evenly_along_a_braked_path(poses: int) -> Metres:
    """Return shares of the braking time for poses at equal distances, (1, poses + 1): dense at high speed."""
    shares: Metres = 1.0 - np.sqrt(1.0 - np.linspace(0.0, 1.0, poses + 1))
    return shares[None]


def _path(states: list[_State]) -> Path:
    return Path(*np.array([state[:4] for state in states]).T[:, None])


# --- points near the path -------------------------------------------------------------------------


def _near(
    points: Points,
    onset: list[_State],
    whole: _State,
    rates: _Rates,
    footprint: Footprint,
    profile: GateProfile,
    period_s: float,
) -> Rows:
    """Return the rows of the points to which the hull may come too near; the others are out of its reach.

    No row is returned if the whole candidate is surely clear. With a smaller share of the candidate, the base
    is never faster, and it begins to brake at nearly the same pose: in one period, rate limits allow only
    small differences of speed and heading.
    """
    swing_m = 0.0 if footprint.turns_freely else footprint.reach(0.0)
    spread = _spread(onset, whole, rates)
    speed_up, turn_up = rates.linear_up + rates.linear_down, rates.angular_up + rates.angular_down
    elsewhere_m = period_s**2 * (2.0 * speed_up + (swing_m + sum(spread[:4])) * turn_up)
    margin_m = footprint.sharpness * (profile.parameters.hard_margin_m + _EXACT_M)
    gaps = footprint.gaps_about(Pose(whole.x, whole.y, whole.yaw), spread, points, margin_m + elsewhere_m)
    near: Rows = (gaps <= margin_m + elsewhere_m).nonzero()[0]
    return near if len(near) and np.minimum.reduce(gaps.take(near)) <= margin_m else near[:0]


def _spread(onset: list[_State], whole: _State, rates: _Rates) -> Spread:
    """Return where the base may be before it brakes from `whole`, and while it brakes.

    The base brakes each axis separately. So it moves at most d = v^2 / 2a, and its heading changes by at most
    theta = w^2 / 2 alpha. It may move d ahead, but at most d sin(theta) aside.
    """
    (x, y, yaw, _, (vx, vy, w)), down = whole, rates.linear_down
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = w * w / (2.0 * rates.angular_down)
    aside = abs(vy) * vy / (2.0 * down)
    onward = abs(vx) * vx / (2.0 * down)
    if turned > math.pi / 2.0:
        ahead = behind = left = right = abs(onward) + abs(aside)
    else:
        swerve = onward * math.sin(turned) * (1.0 if w > 0.0 else -1.0)
        slip = abs(aside) * math.sin(turned)
        ahead, behind = max(onward, 0.0) + slip, max(-onward, 0.0) + slip
        left, right = max(swerve, 0.0) + max(aside, 0.0), max(-swerve, 0.0) + max(-aside, 0.0)
    turned_left, turned_right = (turned, 0.0) if w > 0.0 else (0.0, turned)
    for state_x, state_y, state_yaw, _, _ in onset:
        dx, dy, off = state_x - x, state_y - y, state_yaw - yaw
        forward, sideways = cos * dx + sin * dy, cos * dy - sin * dx
        if forward > ahead:
            ahead = forward
        elif -forward > behind:
            behind = -forward
        if sideways > left:
            left = sideways
        elif -sideways > right:
            right = -sideways
        if off > turned_left:
            turned_left = off
        elif -off > turned_right:
            turned_right = -off
    return Spread(ahead, behind, left, right, turned_left, turned_right)


def _within(points: Points, drift: Drift | None, path: Path, footprint: Footprint) -> NDArray[np.intp]:
    """Return the indices of the points that the hull may come near on this path, whatever its heading is."""
    x, y = points.T
    reach = footprint.reach(MOVER_MARGIN_M)
    if drift is not None:
        reaches = drift.radius + (np.hypot(*drift.velocity.T) + drift.grows) * path.time_s.max()
        reach += float(reaches.max(initial=0.0))
    return np.flatnonzero(
        (x > path.x.min() - reach)
        & (x < path.x.max() + reach)
        & (y > path.y.min() - reach)
        & (y < path.y.max() + reach)
    )


def _met_no_worse(
    paths: Path,
    drives_until_s: NDArray[np.float64],
    braking_row: int,
    points: Points,
    drift: Drift,
    footprint: Footprint,
) -> NDArray[np.bool_]:
    """Return which points each path meets no earlier, and no faster, than the path that brakes, (rows, N).

    `paths` end with a rest; `drives_until_s`: when each of them no longer drives, but may still turn. If somebody
    cannot be avoided, gaps do not tell which path is better: one that drives through is no deeper.
    """
    each = Path(*(axis.reshape(-1, 1) for axis in paths))
    gaps = footprint.least_gaps(each, points, drift).reshape(*paths.x.shape, -1)
    before, after = gaps[:, :-1], gaps[:, 1:]
    earlier_s, later_s = paths.time_s[:, :-1, None], paths.time_s[:, 1:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        between_s = earlier_s + (later_s - earlier_s) * before / (before - after)
    met_s = np.where(after < 0.0, np.where(before < 0.0, earlier_s, between_s), math.inf).min(axis=1)
    no_worse: NDArray[np.bool_] = met_s >= met_s[braking_row]
    for rests_s in (drives_until_s, paths.time_s[:, -2]):
        moves_on_s = np.maximum(rests_s[:, None] - met_s, 0.0)  # speed, at the same deceleration
        no_worse &= moves_on_s <= moves_on_s[braking_row]
    return no_worse


def _margins(count: int, drift: Drift | None, profile: GateProfile) -> Metres:
    """Return the margin that the hull must keep from each point, metres."""
    hard = np.full(count, profile.parameters.hard_margin_m)
    return hard if drift is None else np.where(drift.moves, MOVER_MARGIN_M, hard)


def _demanded(
    unavoidable: Metres, drift: Drift | None, profile: GateProfile, footprint: Footprint
) -> OneOrEach:
    """Return the distances that the robot must keep: the margins, but at most what braking now would leave.

    This is method 4. Standing and moving points are computed separately.
    """
    share = footprint.demanded_share
    hard = profile.parameters.hard_margin_m
    if drift is None or not (moving := drift.moves).any():
        return allowed_margin(unavoidable, hard, share)
    demanded = np.empty(len(unavoidable))
    demanded[~moving] = allowed_margin(unavoidable[~moving], hard, share)
    demanded[moving] = allowed_margin(unavoidable[moving], MOVER_MARGIN_M, share)
    return demanded
