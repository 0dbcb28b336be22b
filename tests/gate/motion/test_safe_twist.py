"""All rules together on exact points: no contact, no trapped robot, and a lost turn is given back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robots.bridge.gate.motion import braking
from robots.bridge.gate.motion.safe_twist import allowed_margin, restrain
from robots.shared.geometry.footprint import footprint_of
from robots.shared.geometry.poses import Velocity
from tests.gate import strategies
from tests.gate.conftest import box_profile, tiago_profile

PROFILES = {"disc": tiago_profile(), "box": box_profile()}
kinds = st.sampled_from(sorted(PROFILES))
clouds = strategies.clouds(reach_m=1.2)
twists = strategies.twists(decimals=3).filter(any)


def decide(kind, twist, points, turn_rates=()):
    profile = PROFILES[kind]
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    nobody = np.zeros(len(points), dtype=np.intp)
    return restrain(twist, turn_rates, points, nobody, footprint_of(profile), profile)


def braked_path(twist, profile, step_s=0.005):
    """Poses (x, y, yaw) of a robot that keeps `twist` for the latency and then brakes along its arc."""
    latency, brake = profile.parameters.latency_s, braking.braking_time(twist, profile)
    time = np.arange(0.0, latency + brake, step_s)
    share = np.clip(1.0 - (time - latency) / max(brake, 1e-9), 0.0, 1.0)
    yaw = np.cumsum(share * twist.w * step_s)
    x = np.cumsum(share * step_s * (twist.vx * np.cos(yaw) - twist.vy * np.sin(yaw)))
    y = np.cumsum(share * step_s * (twist.vx * np.sin(yaw) + twist.vy * np.cos(yaw)))
    return np.stack((x, y, yaw), axis=1)


@given(kinds, twists, clouds)
def test_an_allowed_twist_brakes_before_every_point(kind, twist, points):
    profile = PROFILES[kind]
    hull = footprint_of(profile)
    points = points[hull.gaps(points) > 0.001]
    assume(len(points))
    allowed = decide(kind, twist, points).velocity
    for x, y, yaw in braked_path(allowed, profile):
        cos, sin = math.cos(yaw), math.sin(yaw)
        local = (points - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        assert hull.gaps(local).min() > -0.004  # tolerance for the simulation's steps


@given(kinds, twists, clouds)
def test_an_allowed_twist_is_a_share_of_the_asked_one(kind, twist, points):
    allowed = decide(kind, twist, points).velocity
    for part, whole in zip(allowed, twist, strict=True):
        assert part * whole >= 0.0 and abs(part) <= abs(whole) + 1e-12


@pytest.mark.parametrize("kind", sorted(PROFILES))
def test_what_was_expected_changes_no_answer(kind):
    """Compare the quick check of near points with the plain check of all points.

    The quick check can err only where a near point slows a little and a farther point slows more: in one
    world of some hundreds.
    """
    profile, random = PROFILES[kind], np.random.default_rng(13)
    hull, reduced = footprint_of(profile), 0
    for _ in range(1000):
        twist = Velocity(random.uniform(-1.0, 1.0), 0.0, random.uniform(-1.0, 1.0))
        points = random.uniform((-0.6, -0.5), (1.6, 0.5), (random.integers(2, 7), 2))
        points[:, 0] *= math.copysign(1.0, twist.vx)
        arguments = twist, (random.uniform(-1.0, 1.0),), np.asfortranarray(points), np.arange(len(points))
        plain = restrain(*arguments, hull, profile)
        reduced += plain.cause is not None
        # Rows of points that may forbid a turn. There may be fewer points.
        guesses = random.integers(0, 8, 2).tolist()
        quick = restrain(*arguments, hull, profile, random.uniform(0.0, 1.0), guesses)
        assert (quick.velocity, quick.cause) == (plain.velocity, plain.cause)
    assert reduced > 500


@pytest.mark.parametrize("kind", sorted(PROFILES))
def test_what_stands_in_the_way_of_one_turn_changes_no_answer(kind, monkeypatch):
    """Compare a search of all turns with a search that skips turns which one point surely forbids."""
    profile, random = PROFILES[kind], np.random.default_rng(14)
    hull, skipped, turned = footprint_of(profile), 0, 0
    for _ in range(1000):
        twist = Velocity(random.uniform(0.3, 1.0), 0.0, random.uniform(-2.0, 2.0))
        points = np.asfortranarray(random.uniform((-0.6, -0.7), (0.9, 0.7), (random.integers(2, 9), 2)))
        arguments = twist, (), points, np.arange(len(points)), hull, profile
        quick = restrain(*arguments)
        with monkeypatch.context() as patch:
            patch.setattr("robots.bridge.gate.motion.safe_twist._is_stopped_by", lambda *_: False)
            plain = restrain(*arguments)
        assert (quick.velocity, quick.cause) == (plain.velocity, plain.cause)
        again = restrain(*arguments, 1.0, quick.guesses)
        assert (again.velocity, again.cause) == (plain.velocity, plain.cause)
        turned += quick.velocity != twist
        skipped += quick.velocity.w != twist.w
    assert turned > 300 and skipped > (0 if kind == "disc" else 100)


@given(st.floats(-math.pi, math.pi), st.floats(-0.03, 0.2))
def test_a_disc_may_always_turn_and_always_retreat(bearing, gap):
    near = [((0.27 + gap) * math.cos(bearing), (0.27 + gap) * math.sin(bearing))]
    turning = Velocity(0.0, 0.0, 1.5)
    assert decide("disc", turning, near).velocity == turning
    away = Velocity(math.copysign(0.2, -math.cos(bearing)), 0.0, 0.0)
    assume(abs(math.cos(bearing)) > 0.05)
    assert decide("disc", away, near).velocity.vx != 0.0


@st.composite
def touching_a_box(draw):
    """A point within 3 cm of the box's edge, inside or outside."""
    along, beyond = draw(st.floats(0.0, 1.0)), draw(st.floats(-0.03, 0.03))
    corners = PROFILES["box"].outline
    first = draw(st.integers(0, 3))
    (x0, y0), (x1, y1) = corners[first], corners[(first + 1) % 4]
    length = math.hypot(x1 - x0, y1 - y0)
    return (
        x0 + along * (x1 - x0) + beyond * (y1 - y0) / length,
        y0 + along * (y1 - y0) - beyond * (x1 - x0) / length,
    )


@given(touching_a_box())
def test_a_box_may_always_do_something_that_leads_away(point):
    """For any touching point, some stick moves the box away from it."""
    sticks = [Velocity(v, 0.0, w) for v in (0.3, 0.0, -0.3) for w in (0.8, 0.0, -0.8) if v or w]
    assert any(decide("box", stick, [point]).velocity == stick for stick in sticks)


@pytest.mark.parametrize("gap", [-0.02, 0.0, 0.005, 0.02])
def test_a_box_backs_off_from_a_wall_that_it_touches(gap):
    wall = [(0.4 + gap, y) for y in np.linspace(-1, 1, 60)]
    back = Velocity(-0.3, 0.0, 0.0)
    assert decide("box", back, wall).velocity == back
    assert decide("box", Velocity(0.3, 0.0, 0.0), wall).velocity.vx == 0.0


@pytest.mark.parametrize("w", [0.8, -0.8])
def test_a_box_turns_its_corner_out_of_a_wall_but_not_into_it(w):
    """A diagonal wall at the front left corner: turning one way frees the corner, the other drives it into the wall."""
    wall = [(0.41 - t, 0.25 + t) for t in np.linspace(-0.05, 0.3, 60)]
    free = decide("box", Velocity(0.0, 0.0, w), wall).velocity.w != 0.0
    assert free == (w < 0.0)


def test_the_allowed_margin_is_at_most_the_current_gap():
    gaps = np.array([0.5, 0.01, 0.2])
    np.testing.assert_allclose(allowed_margin(gaps, 0.03, 1.0), [0.0099])
    inside = np.array([0.5, -0.02, 0.2])
    np.testing.assert_allclose(allowed_margin(inside, 0.03, 1.0), [0.0, -0.0201, 0.0])
    np.testing.assert_allclose(allowed_margin(np.array([0.5, 0.2]), 0.03, 1.0), [0.03])
    np.testing.assert_allclose(allowed_margin(np.array([0.5, 0.02]), 0.03, 0.5), [0.0099])


@given(st.lists(st.floats(-0.3, 1.0), min_size=1).map(np.array), st.sampled_from([0.5, 1.0]))
def test_grown_by_the_allowed_margin_the_hull_holds_no_point(gaps, demanded_share):
    assert (allowed_margin(gaps, 0.03, demanded_share) < gaps).all()


def test_nose_at_the_wall_the_whole_turn_is_given_back():
    wall = [(0.31, y) for y in np.linspace(-1, 1, 80)]
    found = decide("disc", Velocity(0.5, 0.0, 1.0), wall)
    assert found.velocity == Velocity(0.0, 0.0, 1.0)
    assert found.cause.rule == "obstacle"


@given(st.floats(0.45, 1.2), st.floats(-0.28, 0.28))
def test_given_back_rotation_is_safe_itself(x, y):
    stick = Velocity(0.8, 0.0, 1.2)
    points = np.array([(x, y)])
    allowed = decide("disc", stick, points).velocity
    again = decide("disc", allowed, points).velocity
    assert again.vx == pytest.approx(allowed.vx, rel=0.01)


def test_the_arc_that_the_base_still_follows_must_be_clear_too():
    ahead = [(1.0, y) for y in np.linspace(-0.3, 0.3, 30)]
    evading = Velocity(1.0, 0.0, 2.0)
    assert decide("disc", evading, ahead, turn_rates=(2.0,)).velocity.vx == pytest.approx(1.0)
    held = decide("disc", evading, ahead, turn_rates=(0.0,)).velocity
    assert held.vx < 0.85
    assert held.w == pytest.approx(2.0), "it is kept from going on, not from turning"


@pytest.mark.parametrize(("clearance", "fastest"), [(0.03, 0.10), (0.05, 0.35), (0.08, 0.725), (0.13, 1.0)])
def test_passing_close_by_is_slow(clearance, fastest):
    posts = [(0.02, 0.27 + clearance), (0.02, -0.27 - clearance)]
    found = decide("disc", Velocity(1.0, 0.0, 0.0), posts)
    assert found.velocity.vx == pytest.approx(fastest, abs=0.03)
    assert (found.cause is None) == (fastest == 1.0)


def test_a_wall_is_approached_at_braking_speed():
    """The wall's sides are near misses, but only later on the way."""
    wall = [(1.0, y) for y in np.linspace(-1, 1, 400)]
    assert decide("disc", Velocity(1.0, 0.0, 0.0), wall).velocity.vx > 0.75


def test_points_behind_do_not_hold_back():
    behind = [(-0.3, y) for y in np.linspace(-0.2, 0.2, 20)]
    forward = Velocity(1.0, 0.0, 0.0)
    assert decide("disc", forward, behind).velocity == forward


def test_no_points_at_all_leave_everything():
    forward = Velocity(1.0, 0.0, 1.0)
    assert decide("disc", forward, []).velocity == forward
    assert decide("box", forward, []).velocity == forward


def test_a_holonomic_base_is_held_off_sideways():
    profile = box_profile(limits=box_profile().limits.__class__(1.0, 1.0, 1.0, 2.0, 1.0, 2.0))
    wall = np.array([(x, 0.6) for x in np.linspace(-1, 1, 80)])
    nobody = np.zeros(len(wall), dtype=np.intp)
    hull = footprint_of(profile)
    left = restrain(Velocity(0.0, 0.8, 0.0), (), wall, nobody, hull, profile)
    assert 0.0 < left.velocity.vy < 0.6
    right = restrain(Velocity(0.0, -0.8, 0.0), (), wall, nobody, hull, profile)
    assert right.velocity.vy == -0.8
