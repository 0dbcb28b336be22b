"""Hulls of several discs: one disc behaves like a round hull, several like the union of each."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robots.shared.geometry import arc
from robots.shared.geometry.footprint import Disc, Discs, Footprint, Polygon, Spread, footprint_of
from robots.shared.geometry.planar import ORIGIN, Drift, Path, placed, put, relative_to
from robots.shared.geometry.poses import Pose, Velocity
from tests.gate.conftest import box_profile, tiago_profile
from tests.gate.geometry.test_arc import (
    check_against,
    clearances_of,
    contact_times,
    path_in_base_frame,
    points,
    twists,
)

REACHING = ((-0.15, 0.0, 0.25), (0.2, 0.0, 0.22), (0.45, 0.1, 0.08))
HULLS: dict[str, Footprint] = {
    "disc": Disc(0.3),
    "discs": Discs(REACHING),
    "box": Polygon(((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25))),
}
RIMS = {
    "disc": [(0.3 * math.cos(angle), 0.3 * math.sin(angle)) for angle in np.arange(0.0, 6.2, 0.3)],
    "discs": [(-0.4, 0.0), (0.53, 0.1), (0.2, 0.22), (0.2, -0.22)],
    "box": [(0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25)],
}
clouds = st.lists(points, min_size=1, max_size=12).map(np.array)
hulls = st.sampled_from(sorted(HULLS))


@given(twists, points, st.sampled_from([0.0, 0.03]))
def test_contact_of_discs_is_when_brute_force_says(twist, point, hull_growth):
    hull = HULLS["discs"]
    assume(hull.gaps(point[None])[0] > hull_growth + 1e-6)
    time, path = path_in_base_frame(point, twist)
    gaps = hull.gaps(path) - hull_growth
    contact = float(contact_times(hull, point[None], twist, hull_growth)[0])
    check_against(gaps, time, contact, tolerance_m=0.008)


@given(twists, clouds)
def test_one_disc_about_the_origin_is_a_disc(twist, cloud):
    one, disc = Discs(((0.0, 0.0, 0.3),)), Disc(0.3)
    np.testing.assert_allclose(one.gaps(cloud), disc.gaps(cloud))
    hull_growth = float(np.min(disc.gaps(cloud))) - 0.001
    np.testing.assert_allclose(
        contact_times(one, cloud, twist, hull_growth), contact_times(disc, cloud, twist, hull_growth)
    )
    np.testing.assert_allclose(clearances_of(one, cloud, twist), clearances_of(disc, cloud, twist))
    assert one.reach(0.1) == disc.reach(0.1)


@given(hulls, twists, points)
def test_a_point_keeps_its_clearance_from_the_swept_area(kind, twist, point):
    hull = HULLS[kind]
    assume(arc.speed(twist) or not hull.turns_freely)
    clearance = float(clearances_of(hull, point[None], twist)[0])
    assume(clearance > 0.0)
    _, path = path_in_base_frame(point, twist)
    # A box's gap is measured to its edges' lines: next to a corner, it is less than the distance. An arc of
    # 1 km counts as straight.
    nearest = 0.0 if kind == "box" else clearance
    assert hull.gaps(path).min() > nearest - 0.02
    assert math.isinf(contact_times(hull, point[None], twist)[0])


@given(hulls, twists, clouds)
def test_no_part_of_a_hull_lies_beyond_its_reach(kind, twist, cloud):
    hull = HULLS[kind]
    beyond = cloud[np.hypot(*cloud.T) > hull.reach(0.05)]
    assert (hull.gaps(beyond) >= 0.05 - 1e-9).all()


def test_a_reaching_arm_touches_when_the_robot_turns():
    turning = Velocity(0.0, 0.0, 1.0)
    post = np.array([[0.36, 0.36]])
    time = contact_times(HULLS["discs"], post, turning)[0]
    assert 0.2 < time < 0.8
    assert not HULLS["discs"].turns_freely
    assert math.isinf(contact_times(HULLS["disc"], post, turning)[0])


poses = st.lists(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3), st.floats(0, 2)), min_size=2, max_size=8
)


@given(hulls, poses, clouds, st.booleans())
def test_least_gaps_are_those_of_pose_by_pose(kind, several, cloud, drifting):
    hull = HULLS[kind]
    discs = np.full(len(cloud), 0.1), np.full(len(cloud), 0.3)
    drift = Drift(np.flip(cloud, axis=0) / 2.0, *discs) if drifting else None
    rows = [several, several[::-1][:1] * len(several)]
    path = Path(*(np.array([[pose[n] for pose in row] for row in rows]) for n in range(4)))
    found = hull.least_gaps(path, cloud, drift)
    for row, gaps in zip(rows, found, strict=True):
        least = np.full(len(cloud), np.inf)
        for x, y, yaw, time_s in row:
            there = cloud if drift is None else cloud + time_s * drift.velocity
            discs_m = 0.0 if drift is None else drift.radius + time_s * drift.grows
            cos, sin = math.cos(yaw), math.sin(yaw)
            local = (there - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
            least = np.minimum(least, hull.gaps(local) - discs_m)
        outside = least > -0.2  # deep inside a disc the gap is not exact to 1 mm
        np.testing.assert_allclose(gaps[outside], least[outside], atol=2e-5)


@given(
    hulls,
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3)),
    st.tuples(*[st.floats(0, 0.6)] * 4, *[st.floats(0, 2)] * 2),
    st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=1, max_size=8),
    clouds,
)
def test_a_spread_base_is_nowhere_nearer_than_its_gaps_say(kind, at, sizes, shares, cloud):
    """Bases within the spread are checked, also those at its four corners and with the largest turns."""
    hull, there, spread = HULLS[kind], Pose(*at), Spread(*sizes)
    about = hull.gaps_about(there, spread, cloud, math.inf)
    near_m = float(np.median(about))
    quick = hull.gaps_about(there, spread, cloud, near_m)
    np.testing.assert_array_equal(quick <= near_m, about <= near_m)
    corners = [(x, y, turn) for x in (-1, 1) for y in (-1, 1) for turn in (-1, 0, 1)]
    for x, y, turn in [*corners, *shares]:
        along = x * (spread.ahead if x > 0 else spread.behind)
        aside = y * (spread.left if y > 0 else spread.right)
        base = put(
            Pose(along, aside, turn * (spread.turned_left if turn > 0 else spread.turned_right)), there
        )
        gaps = hull.gaps(placed(cloud, relative_to(ORIGIN, base)))
        assert (about <= np.maximum(gaps, 0.0) * hull.sharpness + 1e-9).all()
        rim = placed(np.array(RIMS[kind]), base)
        assert (hull.gaps_about(there, spread, rim, math.inf) <= 1e-9).all()


@pytest.mark.parametrize("kind", sorted(HULLS))
@pytest.mark.parametrize(("left", "right"), [(1.2, 0.0), (0.0, 1.2), (0.3, 0.3), (1.8, 0.0)])
def test_on_its_way_round_a_hull_stays_within_its_gaps(kind, left, right):
    """A corner is farthest out somewhere in the turn, not at its end."""
    hull, spread = HULLS[kind], Spread(0.0, 0.0, 0.0, 0.0, left, right)
    for turn in np.linspace(-right, left, 40):
        rim = placed(np.array(RIMS[kind]), Pose(0.0, 0.0, float(turn)))
        assert (hull.gaps_about(ORIGIN, spread, rim, math.inf) <= 1e-9).all()


@pytest.mark.parametrize("kind", sorted(HULLS))
def test_a_base_that_is_nowhere_else_has_the_gaps_of_its_hull(kind):
    hull, there = HULLS[kind], Pose(0.3, -0.2, 0.7)
    cloud = np.random.default_rng(3).uniform(-2.0, 2.0, (50, 2))
    gaps = hull.gaps(placed(cloud, relative_to(ORIGIN, there)))
    about = hull.gaps_about(there, Spread(0, 0, 0, 0, 0, 0), cloud, math.inf)
    np.testing.assert_allclose(about[gaps > 0.0], gaps[gaps > 0.0], atol=1e-9)


def test_a_footprint_is_discs_then_outline_then_radius():
    assert isinstance(footprint_of(tiago_profile()), Disc)
    assert isinstance(footprint_of(box_profile()), Polygon)
    assert isinstance(footprint_of(box_profile(discs=REACHING)), Discs)
    with pytest.raises(ValueError, match="radius"):
        footprint_of(tiago_profile(radius_m=None))


@pytest.mark.parametrize("bad", [(), ((0.0, 0.0, 0.0),), ((math.nan, 0.0, 0.2),), ((0.0, 0.0, math.inf),)])
def test_discs_that_are_none_are_refused(bad):
    with pytest.raises(ValueError, match=r"disc|radius"):
        Discs(bad)
