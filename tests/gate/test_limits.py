"""Speed limits without obstacles: the robot's own limits, and limits for unwatched directions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.sensing.sectors import gaps_between
from robots.shared.configuration.gate_profile import Limits, Parameters
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.records.verdict import SpeedLimit
from tests.gate.conftest import Feeder, box_profile, tiago_profile


def fed(profile) -> Feeder:
    feeder = Feeder(profile)
    feeder.all()
    return feeder


def test_more_than_the_robot_can_do_is_cut_axis_by_axis(tiago):
    verdict = tiago.decide(3.0, 1.0, -9.0)
    assert verdict.velocity == Velocity(1.0, 0.0, -2.0944)
    assert verdict.code == "robot_limit"
    assert tiago.decide(-1.0).velocity.vx == -0.2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_nan_twist_stops_the_robot(tiago, bad):
    for stick in (Velocity(bad, 0, 0), Velocity(0.1, bad, 0), Velocity(0.1, 0, bad)):
        verdict = tiago.gate.decide(stick, STILL, tiago.now_s)
        assert (verdict.velocity, verdict.code) == (STILL, "invalid")
    unknown = Velocity(bad, bad, bad)
    tiago.now_s += 0.05
    tiago.odometry()
    assert tiago.gate.decide(Velocity(0.4, 0, 0), unknown, tiago.now_s).velocity.vx == pytest.approx(0.05)


@pytest.mark.parametrize("dust", [5e-324, 1e-9, -1e-7])
def test_next_to_nothing_is_nothing(tiago, dust):
    assert tiago.decide(dust, dust, dust).code == "idle"


def test_a_depth_robot_keeps_its_blind_speed_and_says_why():
    feeder = fed(tiago_profile(has_depth=True))
    verdict = feeder.decide(0.9, w=0.6)
    assert verdict.velocity == Velocity(pytest.approx(0.3), 0.0, pytest.approx(0.2)), "the arc is kept"
    assert verdict.code == "depth_missing"
    assert (
        verdict.text == "at most 0.3 m/s: the depth camera is not in use yet: the robot cannot see table tops"
    )
    assert verdict.limits == (SpeedLimit("depth_missing", verdict.text, 0.3),)
    assert verdict.way is None, "whichever it goes"
    assert feeder.decide().limits == verdict.limits, "said while idle, too"
    assert feeder.decide(w=2.0).velocity.w == 2.0, "turning on the spot is no blind travel"
    assert feeder.decide(0.25).code == "free"


def test_an_unwatched_direction_is_limited_to_blind_speed():
    blind_behind = tiago_profile(
        sonar_poses={}, sonar_fov={}, limits=Limits(1.0, 1.0, 0.0, 2.0, 1.0, 2.0), blind_mps=0.15
    )
    feeder = fed(blind_behind)
    verdict = feeder.decide(-0.8)
    assert verdict.velocity.vx == pytest.approx(-0.15)
    assert verdict.code == "blind_direction"
    assert verdict.text == "at most 0.1 m/s in reverse: no sensor looks there"
    assert verdict.limits == (SpeedLimit("blind_direction", verdict.text, 0.15, "reverse"),)
    assert verdict.way == "reverse"
    assert feeder.decide(0.8).code == "free"


def test_a_robot_without_any_sensor_crawls_everywhere():
    bare = tiago_profile(
        scan_poses={},
        sonar_poses={},
        sonar_fov={},
        limits=Limits(1.0, 1.0, 1.0, 2.0, 1.0, 2.0),
        blind_mps=0.2,
    )
    feeder = fed(bare)
    limits = feeder.decide().limits
    assert [(limit.code, limit.way) for limit in limits] == [
        ("blind_direction", way) for way in ("forward", "reverse", "left", "right")
    ]
    for stick in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.7, 0.7)):
        verdict = feeder.decide(*stick)
        assert math.hypot(verdict.velocity.vx, verdict.velocity.vy) == pytest.approx(0.2)
        # The page finds the active limit by code and way only.
        [holds] = [limit for limit in limits if (limit.code, limit.way) == (verdict.code, verdict.way)]
        assert holds.text == verdict.text


def test_sonars_leave_gaps_between_and_above_them():
    feeder = Feeder(tiago_profile(parameters=Parameters()))
    feeder.all()
    verdict = feeder.decide(-0.2, w=0.3)
    text = "at most 0.1 m/s in reverse: no sensor looks between and above the sonars"
    assert (verdict.code, verdict.text, verdict.way) == ("blind_direction", text, "reverse")
    assert verdict.velocity == pytest.approx(Velocity(-0.1, 0.0, 0.15))
    assert verdict.limits == (SpeedLimit("blind_direction", text, 0.1, "reverse"),)
    assert feeder.decide(0.5).code == "free"
    assert feeder.decide(-0.09).code == "free"


@pytest.mark.parametrize(
    ("trusted_mps", "blind_mps", "left_mps"), [(0.15, 0.3, 0.15), (1.0, 0.12, 0.12), (1.0, 0.3, 0.2)]
)
def test_a_profile_trusts_sonars_up_to_the_blind_speed(trusted_mps, blind_mps, left_mps):
    parameters = Parameters(between_sonars_mps=trusted_mps)
    feeder = Feeder(tiago_profile(parameters=parameters, blind_mps=blind_mps))
    feeder.all()
    verdict = feeder.decide(-0.2)
    assert verdict.velocity.vx == pytest.approx(-left_mps)
    assert bool(verdict.limits) == (left_mps < 0.2)


def test_the_gate_reports_unwatched_directions(tiago):
    expected = [(-169, -146), (-124, -84), (84, 124), (146, 169)]
    degrees = np.degrees(tiago.gate.unseen(tiago.now_s))
    np.testing.assert_allclose(degrees, expected, atol=1.0)
    tiago.now_s += 0.6
    tiago.scan()
    assert len(tiago.gate.unseen(tiago.now_s)) == 1, "silent sonars see nothing"


@pytest.mark.parametrize(
    ("covered", "gaps"),
    [
        ([], [(-180, 180)]),
        ([(0, 360)], []),
        ([(-90, 90)], [(90, 270)]),
        ([(-190, 10)], [(10, 170)]),
        ([(-90, 90), (80, 180), (180, 260)], [(-100, -90)]),
        ([(-90, 90), (80, 180), (180, 269)], []),
    ],
)
def test_gaps_are_directions_that_no_sector_covers(covered, gaps):
    found = gaps_between([(math.radians(start), math.radians(end)) for start, end in covered])
    assert [tuple(round(math.degrees(bearing)) for bearing in gap) for gap in found] == gaps


def test_an_obstacle_outweighs_a_standing_limit_in_the_words():
    feeder = Feeder(tiago_profile(has_depth=True))
    feeder.ahead_at(0.25)
    feeder.all()
    verdict = feeder.decide(0.9)
    assert verdict.code == "obstacle" and verdict.limits


def test_corners_swing_at_blind_speed_where_nothing_looks():
    feeder = Feeder(box_profile())
    feeder.all()
    verdict = feeder.decide(w=2.0)
    swing = math.hypot(0.4, 0.25)
    assert abs(verdict.velocity.w) * swing == pytest.approx(0.3)
    assert (verdict.code, verdict.text) == (
        "blind_direction",
        "turning at most 0.6 rad/s: no sensor sees where the robot’s corners move",
    )
    assert verdict.way == "turn", "no limit on the way ahead or back"


def test_corners_swing_freely_where_lasers_look_all_round():
    feeder = Feeder(box_profile())
    feeder.ranges = np.full(721, math.inf)
    feeder.all()
    feeder.scan(angle_min=-math.pi, angle_increment=math.tau / 720)
    feeder.now_s += 0.05
    feeder.odometry()
    feeder.scan(angle_min=-math.pi, angle_increment=math.tau / 720)
    assert feeder.decide(w=2.0).code == "free"


def test_a_disc_turns_as_fast_as_it_can_whoever_looks(tiago):
    assert tiago.decide(w=2.0).code == "free"
