"""The arc formulas, compared with a simulation in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from robots.shared.geometry import arc
from robots.shared.geometry.footprint import Disc, Discs, Polygon, clearances
from robots.shared.geometry.poses import Velocity

SPAN_S = 6.0
STEP_S = 0.002
RADIUS = 0.3


def no_dust(axis):
    """Set tiny values to zero, as the gate does before it computes arcs."""
    return axis if abs(axis) > 1e-6 else 0.0


twists = st.builds(
    Velocity,
    st.floats(-1.0, 1.0).map(no_dust),
    st.sampled_from([0.0, 0.0, 0.5, -0.3, 0.8]),
    st.one_of(st.just(0.0), st.floats(-2.0, 2.0), st.floats(-1e-3, 1e-3)).map(no_dust),
).filter(any)
quick_turns = st.builds(
    Velocity,
    st.floats(-1.0, 1.0).map(no_dust),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([1.2, 2.0, -1.5]),
)
points = st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5)).map(np.array)
outlines = st.sampled_from(
    [
        ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25)),
        ((0.5, 0.0), (-0.3, 0.35), (-0.3, -0.35)),
        ((0.35, -0.1), (0.35, 0.1), (0.1, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.1, -0.3)),
    ]
)


def contact_times(hull, points, twist, hull_growth=0.0):
    """Time (s) at which the hull first touches each point; infinity for never."""
    direction = arc.direction_of(twist)
    each = [arc.courses(arc.seen_along(point[None], direction), direction, [twist]) for point in points]
    return np.array([hull.contacts(courses, hull_growth, 0.0)[0].until_s for courses in each])


def clearances_of(hull, points, twist):
    direction = arc.direction_of(twist)
    tracks = arc.courses(arc.seen_along(points, direction), direction, [twist]).track(
        0, np.arange(len(points))
    )
    return clearances(tracks, twist, hull)


def path_in_base_frame(point, twist):
    """Times, and the path (S, 2) of a fixed point in the base frame of a robot that follows `twist`."""
    time = np.arange(0.0, SPAN_S, STEP_S)
    yaw = twist.w * time
    sin_over = np.where(np.abs(yaw) < 1e-9, time, np.sin(yaw) / np.where(twist.w == 0, 1, twist.w))
    versed = np.where(
        np.abs(yaw) < 1e-9, yaw * time / 2.0, (1.0 - np.cos(yaw)) / np.where(twist.w == 0, 1, twist.w)
    )
    x = twist.vx * sin_over - twist.vy * versed
    y = twist.vx * versed + twist.vy * sin_over
    dx, dy = point[0] - x, point[1] - y
    return time, np.stack((np.cos(yaw) * dx + np.sin(yaw) * dy, -np.sin(yaw) * dx + np.cos(yaw) * dy), axis=1)


def check_against(gaps_at, time, contact_s, tolerance_m):
    """Check that the gap first closes at `contact_s`."""
    before = time < contact_s - STEP_S
    assert gaps_at[before].min(initial=np.inf) > -tolerance_m, "touched before the contact time"
    if contact_s < SPAN_S - STEP_S:
        at = round(contact_s / STEP_S)
        assert abs(gaps_at[at]) < tolerance_m, "no touch at the contact time"


@given(twists, points)
@example(Velocity(1.0, 0.0, 0.0), np.array([1.0, 0.299]))
@example(Velocity(0.3, 0.0, 1.0), np.array([0.0, 0.5]))
def test_disc_contact_is_when_brute_force_says(twist, point):
    assume(math.hypot(*point) > RADIUS + 1e-6)
    time, path = path_in_base_frame(point, twist)
    gaps = np.hypot(*path.T) - RADIUS
    contact = float(contact_times(Disc(RADIUS), point[None], twist)[0])
    check_against(gaps, time, contact, tolerance_m=0.008)


@given(twists, points, outlines, st.sampled_from([0.0, 0.05]))
def test_polygon_contact_is_when_brute_force_says(twist, point, outline, hull_growth):
    hull = Polygon(outline)
    assume(hull.gaps(point[None])[0] > hull_growth + 1e-6)
    time, path = path_in_base_frame(point, twist)
    gaps = hull.gaps(path) - hull_growth
    contact = float(contact_times(hull, point[None], twist, hull_growth)[0])
    check_against(gaps, time, contact, tolerance_m=0.012)


def plain_disc_contact(point, twist, radius):
    """The formula of docs/gate.md for one point: t = (phi - Delta) / |w|."""
    if arc.is_straight(twist):
        ahead, aside = arc.seen_along(point[None], arc.direction_of(twist))[0]
        if abs(aside) >= radius or ahead <= 0.0:
            return math.inf
        return max(ahead - math.sqrt(radius**2 - aside**2), 0.0) / arc.speed(twist)
    cx, cy = arc.centre(twist)
    rho, d = math.hypot(cx, cy), math.hypot(point[0] - cx, point[1] - cy)
    if rho == 0.0 or abs(d - rho) >= radius:
        return math.inf
    sense = math.copysign(1.0, twist.w)
    bearing = math.atan2(point[1] - cy, point[0] - cx) - math.atan2(-cy, -cx)
    delta = math.acos(min((d**2 + rho**2 - radius**2) / (2.0 * d * rho), 1.0))
    return max((sense * bearing) % math.tau - delta, 0.0) / abs(twist.w)


def plain_polygon_contact(point, twist, edges, hull_growth):
    """The first time (s) at which one point's circle crosses a grown edge from outside to inside."""
    direction, first = arc.direction_of(twist), math.inf
    px, py = arc.seen_along(point[None], direction)[0]
    normals = arc.seen_along(edges.normals, direction)
    straight, v = arc.is_straight(twist), arc.speed(twist)
    for number, (nx, ny) in enumerate(normals):
        height = edges.offsets[number] + hull_growth
        low, high = (edges.ends + hull_growth * edges.stretch)[:, number]
        if straight:
            if nx <= 0.0:
                continue
            travel = px - (height - ny * py) / nx
            x, y = px - travel, py
            moment = travel / v if travel >= 0.0 else math.inf
        else:
            cy, sense = v / twist.w, math.copysign(1.0, twist.w)
            d, off = math.hypot(px, py - cy), height - ny * cy
            if abs(off) > d:
                continue
            # In the base frame a point turns against the twist; it enters where it moves against the normal.
            at = math.atan2(ny, nx) - sense * math.acos(off / d)
            x, y = d * math.cos(at), cy + d * math.sin(at)
            moment = (sense * (math.atan2(py - cy, px) - at)) % math.tau / abs(twist.w)
        if low <= x * -ny + y * nx <= high:
            first = min(first, moment)
    return first


@given(twists, st.lists(points, min_size=1, max_size=20), outlines, st.sampled_from([0.0, 0.05]))
def test_all_points_at_once_are_met_when_the_plain_formula_says(twist, several, outline, hull_growth):
    """Several twists that begin in one direction are checked in one call, as in the gate."""
    together, direction = np.array(several), arc.direction_of(twist)
    others = [twist._replace(w=w) for w in (0.7, -1.6) if any(twist[:2])]
    for hull in (Disc(RADIUS), Polygon(outline)):
        outside = together[hull.gaps(together) > hull_growth + 1e-6]
        if not len(outside):
            continue
        arcs = [twist, *others]
        found = hull.contacts(
            arc.courses(arc.seen_along(outside, direction), direction, arcs), hull_growth, 0.0
        )
        for one, contact in zip(arcs, found, strict=True):
            plain = [
                plain_disc_contact(point, one, RADIUS + hull_growth)
                if isinstance(hull, Disc)
                else plain_polygon_contact(point, one, hull.edges, hull_growth)
                for point in outside
            ]
            assert contact.until_s == pytest.approx(min(plain), abs=1e-6)


@given(twists, points, outlines, st.sampled_from([0.0, 0.05]), st.sampled_from([0.0, 0.08]))
@example(
    Velocity(0.53125, 0.5, 0.000873),
    np.array([1.0, 0.99]),
    ((0.5, 0.0), (-0.3, 0.35), (-0.3, -0.35)),
    0.0,
    0.0,
)
def test_one_point_alone_is_met_when_all_at_once_are(twist, point, outline, hull_growth, reserve_m):
    assume(not arc.is_straight(twist))
    direction = arc.direction_of(twist)
    seen = arc.seen_along(point[None], direction)
    x, y = seen[0].tolist()
    for hull in (Polygon(outline), Disc(RADIUS)):
        if hull.gaps(point[None])[0] > hull_growth + 1e-6:
            together = hull.contacts(arc.courses(seen, direction, [twist]), hull_growth, reserve_m)[0]
            alone_s = hull.meets_s(x, y, direction, twist, hull_growth, reserve_m)
            assert alone_s == pytest.approx(together.until_s, abs=1e-9)


@given(twists, st.lists(points, min_size=1, max_size=20), outlines, st.sampled_from([0.0, 0.08]))
def test_the_first_point_touched_is_reported(twist, several, outline, reserve_m):
    together, direction = np.array(several), arc.direction_of(twist)
    for hull in (Disc(RADIUS), Polygon(outline), Discs(((-0.15, 0.0, 0.25), (0.2, 0.1, 0.22)))):
        each = hull.gaps(together) - 0.01  # one hull_growth for each point
        for hull_growth in (float(each.min()), each):
            courses = arc.courses(arc.seen_along(together, direction), direction, [twist])
            first = hull.contacts(courses, hull_growth, reserve_m)[0]
            alone = [
                hull.contacts(
                    arc.courses(arc.seen_along(together[[n]], direction), direction, [twist]),
                    hull_growth if isinstance(hull_growth, float) else hull_growth[[n]],
                    reserve_m,
                )[0].until_s
                for n in range(len(together))
            ]
            assert first.until_s == pytest.approx(min(alone))
            assert math.isinf(first.until_s) or alone[first.row] == pytest.approx(first.until_s)


def test_a_disc_that_turns_on_the_spot_touches_nothing():
    near = np.array([[0.3001, 0.0], [0.0, -0.3001], [5.0, 5.0]])
    assert np.isinf(contact_times(Disc(RADIUS), near, Velocity(0.0, 0.0, 2.0))).all()


def test_nearly_straight_and_barely_turning_agree():
    ahead = np.array([[2.0, 0.1], [1.0, -0.25], [3.0, 0.5]])
    straight = contact_times(Disc(RADIUS), ahead, Velocity(1.0, 0.0, 0.00099))
    turning = contact_times(Disc(RADIUS), ahead, Velocity(1.0, 0.0, 0.00101))
    np.testing.assert_allclose(straight, turning, atol=0.01)


@given(quick_turns, points, outlines)
def test_clearance_is_the_smallest_gap_of_a_whole_turn(twist, point, outline):
    _, path = path_in_base_frame(point, twist)  # 6 s at 1.2 rad/s is more than a whole turn
    disc = Disc(RADIUS)
    assert abs(clearances_of(disc, point[None], twist)[0] - disc.gaps(path).min()) < 0.01
    hull = Polygon(outline)
    clearance, gap = clearances_of(hull, point[None], twist)[0], hull.gaps(path).min()
    if clearance < -0.01:
        assert gap < 0.01, "swept, so it comes inside at some time"
    else:
        assert gap - 0.01 <= clearance, "the gap counts by edges, which is never more than the distance"
        assert clearance < 0.01 or gap > -0.01


@pytest.mark.parametrize(
    "outline",
    [
        ((0.4, -0.25), (-0.4, -0.25), (-0.4, 0.25), (0.4, 0.25)),  # clockwise
        ((0.4, -0.25), (0.4, 0.25), (0.0, 0.0), (-0.4, 0.25), (-0.4, -0.25)),  # a dent
        ((0.0, 0.0), (1.0, 0.0)),
        ((0.0, 0.0), (0.0, 0.0), (1.0, 1.0)),
        ((0.0, 0.0), (1.0, math.nan), (0.0, 1.0)),
    ],
)
def test_a_concave_or_clockwise_outline_is_refused(outline):
    with pytest.raises(ValueError, match=r"outline"):
        Polygon(outline)
