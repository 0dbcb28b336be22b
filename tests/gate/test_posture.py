"""The arm is part of the footprint."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.bridge.gate.arm.discs import AT_HOME, UNKNOWN, Posture, beyond, discs_along, is_home
from robots.shared.geometry.footprint import Discs
from robots.shared.records.verdict import SpeedLimit
from tests.gate.conftest import Feeder, box_profile, tiago_profile

RADIUS_M = 0.09
ahead = Posture(at_home=False, discs=discs_along(np.array([(0.15, 0.0), (0.45, 0.0), (0.8, 0.0)]), RADIUS_M))
coordinate = st.floats(-1.0, 1.0)


@pytest.fixture
def arm() -> Feeder:
    feeder = Feeder(tiago_profile(has_arm=True))
    feeder.all()
    return feeder


@given(st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=6), st.floats(0, 1), st.floats(-1, 1))
def test_the_discs_cover_the_whole_arm(line, along, aside):
    points = np.array(line)
    hull = Discs(discs_along(points, RADIUS_M))
    for begin, end in itertools.pairwise(points):
        way = end - begin
        if (length := float(np.hypot(*way))) > 1e-6:
            across = np.array([-way[1], way[0]]) / length
            flank = begin + along * way + aside * RADIUS_M * across
            assert hull.gaps(flank[None])[0] < RADIUS_M / 3.0


def test_an_arm_within_the_base_adds_nothing():
    assert beyond(((0.1, 0.0, 0.1), (0.2, 0.0, 0.1)), 0.27) == ((0.2, 0.0, 0.1),)


def test_home_is_every_joint_in_tolerance_or_unknown():
    home = {"a": 0.2, "b": -1.3}
    assert is_home({"a": 0.25, "b": -1.25, "wheel": 9.0}, home, 0.1) is True
    assert is_home({"a": 0.35, "b": -1.3}, home, 0.1) is False
    assert is_home({"a": 0.2}, home, 0.1) is None


def test_at_home_the_footprint_is_the_base_and_nothing_is_held(arm):
    arm.gate.observe_posture(AT_HOME, arm.now_s)
    assert arm.decide(0.8).code == "free"
    assert arm.gate.footprint.reach(0.0) == pytest.approx(0.27)


@pytest.mark.parametrize("posture", [UNKNOWN, None])
def test_an_arm_anywhere_limits_the_robot_to_0_2_mps(arm, posture):
    if posture is not None:
        arm.gate.observe_posture(posture, arm.now_s)
    verdict = arm.decide(0.8)
    assert (verdict.code, verdict.velocity.vx) == ("arm_away", pytest.approx(0.2))
    why = "the arm’s position is not known" if posture is None else "the arm is away from home"
    assert verdict.text == f"at most 0.2 m/s: {why}"
    assert SpeedLimit("arm_away", verdict.text, 0.2) in verdict.limits


def test_a_posture_is_known_for_half_a_second(arm):
    arm.gate.observe_posture(AT_HOME, arm.now_s)
    for seconds, code in ((0.49, "free"), (0.02, "arm_away")):
        arm.now_s += seconds
        arm.all()
        assert arm.decide(0.8).code == code


def test_an_arm_that_reaches_ahead_stops_before_the_base_would(arm):
    arm.ahead_at(0.8)
    arm.stay(5.0)
    arm.gate.observe_posture(AT_HOME, arm.now_s)
    base = arm.decide(0.3)
    arm.gate.observe_posture(ahead, arm.now_s)
    stretched = arm.decide(0.3)
    assert base.code == "free"
    assert stretched.code == "obstacle" and stretched.velocity.vx < base.velocity.vx
    assert stretched.distance_m == pytest.approx(1.0 - 0.8 - RADIUS_M * math.hypot(1.0, 0.75), abs=0.02)


def test_turning_a_stretched_arm_into_a_thing_is_stopped(arm):
    arm.ranges = np.full(571, math.inf)
    arm.ranges[285 + 60 : 285 + 90] = 0.55  # ahead left, within the arm's reach
    arm.now_s += 0.05
    arm.all()
    arm.gate.observe_posture(AT_HOME, arm.now_s)
    assert arm.decide(w=1.0).code == "free"
    arm.gate.observe_posture(ahead, arm.now_s)
    verdict = arm.decide(w=1.0)
    assert verdict.code == "obstacle" and abs(verdict.velocity.w) < 1.0


def test_laser_points_under_the_arm_still_count(arm):
    arm.gate.observe_posture(ahead, arm.now_s)
    arm.ahead_at(0.1)  # at 0.3 m, under the arm
    arm.now_s += 0.05
    arm.all()
    assert arm.decide(0.3).velocity.vx < 0.05
    assert arm.decide(-0.1).velocity.vx < 0.0, "and the way out stays open"


def test_back_home_the_footprint_is_the_base_again(arm):
    arm.gate.observe_posture(ahead, arm.now_s)
    arm.gate.observe_posture(AT_HOME, arm.now_s)
    assert arm.gate.footprint.reach(0.0) == pytest.approx(0.27)


def test_a_robot_without_an_arm_knows_nothing_of_it(tiago):
    assert tiago.decide(0.8).code == "free"


def test_a_box_held_by_its_arm_is_not_limited_again_below_it():
    feeder = Feeder(box_profile(has_arm=True))
    feeder.ranges = np.full(571, math.inf)
    feeder.ranges[255:316] = 0.7  # just before the hand
    feeder.ranges[281:290] = 0.55  # under it
    feeder.all()
    feeder.gate.observe_posture(Posture(at_home=False, discs=((0.55, 0.0, 0.12),)), feeder.now_s)
    assert feeder.decide(0.8).velocity.vx == 0.0


def test_a_limb_that_may_move_holds_the_robot_to_a_crawl():
    feeder = Feeder(tiago_profile())
    feeder.all()
    feeder.gate.observe_lost_limb("torso")
    verdict = feeder.decide(0.8)
    assert (verdict.code, verdict.velocity.vx) == ("arm_away", pytest.approx(0.2))
    assert verdict.text == ("at most 0.2 m/s: the torso may still move, because its joint states ended")
    feeder.gate.observe_lost_limb(None)
    assert feeder.decide(0.8).code == "free"
