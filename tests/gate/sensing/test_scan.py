"""From measurements to points: noise, bad data, matching by stamps, sonar cones and their memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.gate.sensing.scan import Sweep, cone_points, differences, has_neighbour, outside_hull
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.bridge.gate.values import LaserScan
from robots.shared.geometry.footprint import Disc
from robots.shared.geometry.planar import placed, relative_to
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, Feeder, tiago_profile

NAN, INF = math.nan, math.inf


def test_a_beam_without_neighbour_is_noise_unless_a_thin_leg():
    alone = np.array([NAN, NAN, NAN, 1.0, NAN, NAN, NAN, NAN])
    assert not has_neighbour(alone, differences(alone)).any()
    two = np.array([NAN, NAN, 1.0, NAN, 1.05, NAN, NAN, NAN])
    assert list(np.flatnonzero(has_neighbour(two, differences(two)))) == [2, 4]
    too_far_apart = np.array([NAN, NAN, 1.0, 1.2, NAN, NAN, NAN, NAN])
    assert not has_neighbour(too_far_apart, differences(too_far_apart)).any()
    three_beams_away = np.array([NAN, NAN, 1.0, NAN, NAN, 1.0, NAN, NAN])
    assert not has_neighbour(three_beams_away, differences(three_beams_away)).any()


def test_free_unknown_and_too_near_are_three_things():
    ranges = [INF, INF, NAN, NAN, 0.04, 0.04, 30.0, 30.0, -INF, -INF, 2.0, 2.0, INF, NAN]
    points = Sweep(ranges, 0.0, 0.1, 0.05, 25.0).points()
    np.testing.assert_allclose(np.hypot(*points.T), [0.05, 0.05, 2.0, 2.0])


def test_the_hull_is_no_obstacle_but_grazing_points_are():
    points = np.array([[0.1, 0.0], [0.239, 0.0], [0.241, 0.0], [0.3, 0.0]])
    np.testing.assert_allclose(outside_hull(points, Disc(0.27)), points[2:])


MALFORMED = {
    "no beams": {"ranges": []},
    "one beam": {"ranges": [1.0]},
    "not a list": {"ranges": None},
    "words": {"ranges": ["near", "far"]},
    "two dimensions": {"ranges": [[1.0, 2.0], [1.0, 2.0]]},
    "ragged": {"ranges": [[1.0], [1.0, 2.0]]},
    "all unknown": {"ranges": [NAN] * 571},
    "angle not a number": {"angle_min": NAN},
    "angle infinite": {"angle_min": INF},
    "angle a word": {"angle_min": "left"},
    "angle None": {"angle_min": None},
    "no increment": {"angle_increment": 0.0},
    "increment not a number": {"angle_increment": NAN},
    "increment absurd": {"angle_increment": 40.0},
    "increment next to nothing": {"angle_increment": 1e-300},
    "round and round": {"angle_increment": 0.1},
    "range limits swapped": {"range_min_m": 5.0, "range_max_m": 1.0},
    "range limit not a number": {"range_max_m": NAN},
    "range limit negative": {"range_min_m": -1.0},
}


@pytest.mark.parametrize("what", MALFORMED)
def test_a_malformed_scan_is_dropped_with_a_reason(what):
    feeder = Feeder(tiago_profile())
    feeder.odometry()
    feeder.sonars()
    feeder.scan(**MALFORMED[what])
    assert feeder.decide(0.5).code == "scan_missing"
    [laser] = [sensor for sensor in feeder.gate.sensor_health(feeder.now_s) if sensor.kind == "scan"]
    assert not laser.ok and laser.text not in {"", "nothing has come yet"}


@pytest.mark.parametrize("stamp_s", [NAN, INF])
def test_stamps_that_are_no_numbers_are_no_data(stamp_s, tiago):
    tiago.now_s += 0.6
    gate, now_s = tiago.gate, tiago.now_s
    gate.observe_odometry(stamp_s, now_s, Pose(0, 0, 0), STILL)
    tiago.scan(stamp_s=stamp_s)
    gate.observe_range("base_sonar_01_link", stamp_s, now_s, 0.5, 1.0)
    assert not any(sensor.ok for sensor in gate.sensor_health(now_s))


@pytest.mark.parametrize("pose", [Pose(NAN, 0, 0), Pose(0, INF, 0), Pose(1e300, 0, 0), Pose(0, 0, -1e300)])
def test_odometry_of_no_numbers_is_no_odometry(pose):
    feeder = Feeder(tiago_profile())
    feeder.scan()
    feeder.gate.observe_odometry(1.0, feeder.now_s, pose, STILL)
    feeder.gate.observe_odometry(2.0, feeder.now_s, Pose(0, 0, 0), Velocity(NAN, 0, 0))
    feeder.gate.observe_odometry(3.0, feeder.now_s, Pose(0, 0, 0), Velocity(1e300, 0, 0))
    assert feeder.decide(0.5).code == "odometry_missing"


@given(
    st.lists(st.floats(width=32), max_size=40),
    *(st.floats(width=32) for _ in range(4)),
)
def test_no_scan_whatever_raises(ranges, angle_min, increment, range_min, range_max):
    feeder = Feeder(tiago_profile())
    feeder.odometry()
    scan = LaserScan(LASER, 1.0, feeder.now_s, ranges, angle_min, increment, range_min, range_max)
    feeder.gate.observe_scan(scan)
    feeder.decide(0.5, w=0.5)


@given(st.floats(), st.floats())
def test_no_range_whatever_raises(range_m, max_range_m):
    feeder = Feeder(tiago_profile())
    feeder.odometry()
    feeder.scan()
    feeder.gate.observe_range("base_sonar_02_link", 1.0, feeder.now_s, range_m, max_range_m)
    assert np.isfinite(feeder.gate.obstacles(feeder.now_s).points).all()
    feeder.decide(-0.2)


def test_unknown_sources_are_ignored(tiago):
    tiago.gate.observe_range("somebody_else", 1.0, tiago.now_s, 0.1, 1.0)
    tiago.gate.observe_scan(LaserScan("/other", 1.0, tiago.now_s, [0.1, 0.1], 0.0, 0.1, 0.05, 25.0))
    assert not len(tiago.gate.obstacles(tiago.now_s).points)
    assert tiago.gate.sonar_range("somebody_else", tiago.now_s) is None


def test_a_scan_counts_at_its_stamp_however_late_it_comes():
    """Matched by stamps: the robot was at x = 1 at the scan's stamp, and is at x = 1.5 now."""
    feeder = Feeder(tiago_profile())
    for step in range(51):
        moment = 100.0 + 0.02 * step
        feeder.gate.observe_odometry(moment, moment, Pose(0.5 + 0.02 * step, 0, 0), Velocity(1, 0, 0))
    feeder.ahead_at(2.0, half_width_beams=2)
    feeder.now_s = 101.0
    feeder.scan(stamp_s=100.5)
    points = feeder.gate.obstacles(101.0).points
    np.testing.assert_allclose(points[:, 0], 0.202 + 2.0 - 0.5, atol=0.01)


def test_points_move_with_odometry_and_change_only_on_news(tiago):
    tiago.ahead_at(1.0, half_width_beams=2)
    tiago.now_s += 0.1
    tiago.all()
    first = tiago.gate.obstacles(tiago.now_s)
    assert tiago.gate.obstacles(tiago.now_s) is first
    tiago.now_s += 0.02
    tiago.gate.observe_odometry(tiago.stamp_s, tiago.now_s, Pose(0.0, 0.0, 0.3), STILL)
    turned = tiago.gate.obstacles(tiago.now_s)
    expected = placed(first.points, Pose(0.0, 0.0, -0.3))
    np.testing.assert_allclose(turned.points, expected, atol=1e-9)
    assert [turned.names[index] for index in turned.source] == [LASER] * len(turned.points)


def test_a_sonar_echo_is_an_arc_across_its_cone():
    points = cone_points(0.5, 1.0, Pose(-0.259, 0.0, math.pi), 0.5)
    np.testing.assert_allclose(np.hypot(points[:, 0] + 0.259, points[:, 1]), 0.5)
    angles = np.arctan2(points[:, 1], -(points[:, 0] + 0.259))
    assert angles.min() == pytest.approx(-0.25) and angles.max() == pytest.approx(0.25)
    assert len(cone_points(1.0, 1.0, Pose(0, 0, 0), 0.5)) == 0, "at its range limit it saw nothing"
    assert len(cone_points(INF, INF, Pose(0, 0, 0), 0.5)) == 0
    assert len(cone_points(-INF, 1.0, Pose(0, 0, 0), 0.5)) > 0, "closer than it can measure is there"


def test_a_sonar_echo_stays_until_readings_hear_past_it(tiago):
    def hear(range_m):
        tiago.now_s += 0.1
        tiago.odometry()
        tiago.gate.observe_range("base_sonar_02_link", tiago.stamp_s, tiago.now_s, range_m, 1.0)
        return len(tiago.gate.obstacles(tiago.now_s).points)

    for _ in range(3):
        assert hear(0.4) > 0
    assert tiago.gate.sonar_range("base_sonar_02_link", tiago.now_s) == 0.4
    assert hear(1.0) > 0
    assert tiago.gate.sonar_range("base_sonar_02_link", tiago.now_s) is None
    assert hear(1.0) > 0 and hear(1.0) > 0, "echoes get lost"
    assert hear(1.0) == 0


class TestTrail:
    def trail(self):
        trail = Trail(1.0, 2.0)
        for step in range(10):
            trail.add(5.0 + 0.02 * step, Pose(0.02 * step, 0.0, 0.0), Velocity(1.0, 0.0, 0.0))
        return trail

    def test_it_interpolates_between_poses_and_turns_the_short_way(self):
        assert self.trail().pose_at(5.05).x == pytest.approx(0.05)
        trail = Trail(1.0, 2.0)
        trail.add(1.0, Pose(0, 0, math.pi - 0.02), STILL)
        trail.add(1.1, Pose(0, 0, -math.pi + 0.02), STILL)
        assert abs(trail.pose_at(1.05).yaw) == pytest.approx(math.pi)

    def test_it_foretells_a_little_and_no_more(self):
        assert self.trail().pose_at(5.28).x == pytest.approx(0.28)
        assert self.trail().pose_at(5.5) is None
        assert self.trail().pose_at(4.9) is None

    @pytest.mark.parametrize(
        ("stamp_s", "x", "silent_s", "why"),
        [(5.2, 4.0, 0.02, "jump"), (2.0, 0.18, 0.02, "stamps_back"), (5.2, 2.0, 10.0, "jump")],
    )
    def test_a_jump_or_a_clock_set_back_is_another_frame(self, stamp_s, x, silent_s, why):
        trail = self.trail()
        assert trail.break_before(Pose(x, 0.0, 0.0), trail.missing_s(stamp_s, silent_s), None) == why
        trail.forget()
        trail.add(stamp_s, Pose(x, 0.0, 0.0), STILL)
        assert trail.pose_at(5.1) is None and trail.pose_at(stamp_s).x == x and trail.resets == 1

    @pytest.mark.parametrize(("stamp_s", "silent_s"), [(5.2, 0.02), (5.35, 0.19), (3605.0, 0.02), (5.2, 3.0)])
    def test_a_set_clock_or_a_burst_of_messages_is_continuous(self, stamp_s, silent_s):
        trail = self.trail()
        missing_s = trail.missing_s(stamp_s, silent_s)
        assert missing_s < 0.2, "no gap"
        assert trail.break_before(Pose(0.25, 0.0, 0.0), missing_s, None) is None

    @pytest.mark.parametrize(("x", "why"), [(0.18, None), (0.9, None), (1.2, "jump")])
    def test_after_a_gap_the_motion_must_be_possible(self, x, why):
        trail = self.trail()
        assert trail.missing_s(6.2, 1.02) == pytest.approx(1.02)
        assert trail.break_before(Pose(x, 0.0, 0.0), 1.02, Doubt(0.5, 0.1)) == why

    def test_a_hole_in_the_odometry_is_not_bridged(self):
        trail = self.trail()
        trail.add(6.0, Pose(1.0, 0.0, 0.0), STILL)
        assert trail.pose_at(5.6) is None

    def test_it_does_not_grow_for_ever(self):
        trail = Trail(1.0, 2.0)
        for step in range(5000):
            trail.add(0.02 * step, Pose(0, 0, 0), STILL)
        assert len(trail._stamps) <= 400
        assert trail.pose_at(99.0) is not None


@given(*(st.floats(-3, 3) for _ in range(6)))
def test_a_pose_seen_from_another_places_points_alike(x, y, yaw, vx, vy, vyaw):
    pose, viewer = Pose(x, y, yaw), Pose(vx, vy, vyaw)
    points = np.array([[1.0, 2.0], [-0.5, 0.1]])
    there_and_back = placed(placed(points, relative_to(pose, viewer)), viewer)
    np.testing.assert_allclose(there_and_back, placed(points, pose), atol=1e-9)


@pytest.mark.parametrize("useless", [0.0, 0.03, -1.0, math.nan])
def test_a_laser_that_measures_nothing_anywhere_is_no_laser(tiago, useless):
    tiago.now_s += 0.6
    tiago.odometry()
    tiago.ranges = np.full(571, useless)
    tiago.scan()
    verdict = tiago.decide(0.5)
    assert (verdict.velocity, verdict.code) == (STILL, "scan_stale")


@pytest.mark.parametrize("useless", [0.0, 0.03, math.nan])
def test_a_laser_covered_ahead_is_blind_ahead_and_nowhere_else(tiago, useless):
    tiago.ranges = np.full(571, math.inf)
    tiago.ranges[160:410] = useless
    tiago.now_s += 0.05
    tiago.all()
    verdict = tiago.decide(0.5)
    assert verdict.code == "blind_direction"
    assert verdict.velocity.vx == pytest.approx(tiago.gate.profile.blind_mps)


def test_beams_lost_to_noise_do_not_blind_the_gate(tiago):
    tiago.ranges = np.full(571, math.inf)
    tiago.ranges[::3] = math.nan
    tiago.now_s += 0.05
    tiago.all()
    assert tiago.decide(0.5).code == "free"
