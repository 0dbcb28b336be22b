"""Empty boxes around the robot certify that no point limits a twist, without a check of every arc and pose.

The gate checks points twice: `safe_twist.restrain` (methods 1 to 5), then `rollout.safe_share` (method 6).
Each check has a certificate: if its boxes hold no point, the check would change nothing, so it is skipped. If
a box holds a point, the check decides. So a box that is too large costs time only.

The certificate assumes nothing about the past: the points are current. `ObstacleCache` transforms them to the
newest pose when odometry comes, and renews them with each scan, picture, echo or expiry. All rules without
points are decided before: missing and stale data, posture, blind directions, depth camera, latency, the
operator's delay, robot limits, and (before the second check) rate limits.

A box lies about the base origin, with x in the direction of travel and y to the left. Let the wanted twist
have vy = 0 and v = |vx|. Let radius(m) be the radius about the base origin that holds the hull, grown by m.

*Braking* (first check). It follows arcs with the speed v and the turn rates wanted, measured and sent last.
It changes nothing if on each arc the hull, grown by at most m_lat, touches nothing within T + T_b / 2, with
m_front left along the path of the point. With R = v / |w| and r = radius(m_lat), a point that can be touched
is at least R - r away from the centre of rotation, so this reserve is an angle of at most m_front / (R - r).
In this time the base turns by at most theta = |w| (T + T_b / 2) + m_front / (R - r). It goes at most R theta
ahead and, as 1 - cos t <= t^2 / 2, at most R theta^2 / 2 aside. It touches only points within r of this area.
With theta <= pi / 2 it does not come back. On a straight path it goes v (T + T_b / 2) + m_front ahead and
nothing aside. The largest |w| gives the largest box; its corners are rounded by r. In a turn on the spot
(v = 0), the check considers only points within radius(m_lat) + m_front.

*Passing* (first check). Above v_creep the check considers points ahead with a gap below `slowing` +
`harmless`; they are within L = radius(slowing + harmless). Of these it considers, on each arc, the points
that the hull passes by less than `harmless`; they are within q = radius(0) + harmless of the arc's circle.
From (R - q)^2 < x^2 + (y - R)^2 < (R + q)^2 and x^2 + y^2 < L^2 follows |y| < q + L^2 / 2R.

*Playing* (second check). It plays recent commands and the candidate for T and one period, then full braking.
A base changes each of its speeds monotonically towards the commanded speed. So no speed is ever beyond the
extremes of its axis among the measured twist, the recent commands and the candidate: V forward, N backward, S
sideways (wheels slip), W turning. Let P(u) be u (T + period) + u^2 / 2a. The heading changes by at most
Theta = W (T + period) + W^2 / 2 alpha, and Theta <= pi / 2 is required. Without S the base then goes at most
P(V) ahead, P(N) back and Theta (P(V) + P(N)) aside. S adds at most P(S) in any direction. Points farther from
this area than radius(m_hard) are clear.

Nothing is certified in cases that the proof does not cover: a wanted motion sideways, an arc with R <= r,
moving points (second check), a command from the future (a clock was set). Within `LONGEST_M`, `SLACK_M` is
much larger than the rounding errors of these sums, also with the 32 bits of the second check.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robots.bridge.gate.motion import braking
from robots.bridge.gate.motion.corridors import Box, Corridors
from robots.bridge.gate.motion.rollout import Sent
from robots.bridge.gate.motion.safe_twist import harmless_m
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.poses import Velocity

SLACK_M = 0.005
LONGEST_M = 20.0
QUARTER_TURN = math.pi / 2.0


def restrains_nothing(
    wanted: Velocity,
    turn_rates: Sequence[float],
    corridors: Corridors,
    footprint: Footprint,
    profile: GateProfile,
) -> bool:
    """Return whether `safe_twist.restrain`, with the same arguments, surely returns `wanted` unchanged."""
    if wanted.vy != 0.0:
        return False
    v, w = abs(wanted.vx), max(abs(wanted.w), *map(abs, turn_rates))
    reverse = wanted.vx < 0.0
    return _are_clear(corridors, _braked(v, w, footprint, profile), reverse=reverse) and _are_clear(
        corridors, _passed(v, w, footprint, profile), reverse=reverse
    )


def plays_clear(
    candidate: Velocity,
    queue: Sequence[Sent],
    measured: Velocity,
    corridors: Corridors,
    footprint: Footprint,
    profile: GateProfile,
    period_s: float,
) -> bool:
    """Return whether `rollout.safe_share`, with the same standing points, surely leaves `candidate` unchanged."""
    if any(sent.age_s < 0.0 for sent in queue):
        return False
    twists = (candidate, measured, *(sent.velocity for sent in queue))
    return _are_clear(corridors, _played(twists, footprint, profile, period_s))


def _are_clear(corridors: Corridors, box: Box | None, *, reverse: bool = False) -> bool:
    if box is None or max(box) > LONGEST_M:
        return False
    ahead, behind, aside, rounded = box
    grown = Box(ahead + SLACK_M, behind + SLACK_M, aside + SLACK_M, rounded)
    return corridors.are_clear(grown, reverse=reverse)


def _braked(v: float, w: float, footprint: Footprint, profile: GateProfile) -> Box | None:
    """Return the box that holds all points that the hull may touch before the base stands."""
    radius = footprint.reach(profile.parameters.lateral_margin_m)
    if v == 0.0:
        around_m = radius + profile.parameters.front_margin_m
        return Box(around_m, around_m, around_m, around_m)
    tightest_m = v / w if w > 0.0 else math.inf
    if tightest_m <= radius:
        return None
    reserve = profile.parameters.front_margin_m / (1.0 - radius / tightest_m)
    ahead_m = v * braking.horizon(Velocity(v, 0.0, w), profile) + reserve
    theta = ahead_m / tightest_m
    if theta > QUARTER_TURN:
        return None
    return Box(ahead_m + radius, radius, ahead_m * theta / 2.0 + radius, radius)


def _passed(v: float, w: float, footprint: Footprint, profile: GateProfile) -> Box | None:
    """Return the box that holds all points that may slow the base as near misses."""
    parameters = profile.parameters
    if v <= parameters.creep_mps:
        return Box(0.0, 0.0, 0.0)
    linear, _ = braking.deceleration(profile)
    harmless = harmless_m(v, parameters)
    slowing_m = braking.slowing_distance(v, parameters.creep_mps, parameters.latency_s, linear)
    beside = footprint.reach(0.0) + harmless
    far = footprint.reach(slowing_m + harmless)
    return Box(far, 0.0, beside + far * far * w / (2.0 * v))


def _played(
    twists: Sequence[Velocity], footprint: Footprint, profile: GateProfile, period_s: float
) -> Box | None:
    """Return the box in which the hull is until the base has obeyed all commands and has braked."""
    linear, angular = braking.deceleration(profile)
    played_s = profile.parameters.latency_s + period_s
    vx, vy, w = zip(*twists, strict=True)
    fastest = max(max(w), -min(w))
    turned = fastest * (played_s + fastest / (2.0 * angular))
    if turned > QUARTER_TURN:
        return None
    extremes = max(*vx, 0.0), max(-min(vx), 0.0), max(max(vy), -min(vy))
    ahead_m, behind_m, slip_m = (u * (played_s + u / (2.0 * linear)) for u in extremes)
    around_m = footprint.reach(profile.parameters.hard_margin_m) + slip_m
    aside_m = turned * (ahead_m + behind_m)
    return Box(ahead_m + around_m, behind_m + around_m, aside_m + around_m, around_m)
