"""The verdict's text for the operator: sensor, side, distance, asked and allowed speed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate import words
from robots.shared.geometry.poses import Velocity
from tests.gate.conftest import LASER, Feeder, tiago_profile


@pytest.mark.parametrize(
    ("age_s", "text"),
    [
        (0.28, "0.3 s"),
        (59.9, "59.9 s"),
        (61.2, "61 s"),
        (119.0, "119 s"),
        (120.0, "2 min"),
        (870.1, "15 min"),
    ],
)
def test_a_long_time_has_no_tenths(age_s, text):
    assert words.age(age_s) == text


@pytest.mark.parametrize(
    ("degrees", "side"),
    [
        (0, "ahead"),
        (20, "ahead"),
        (45, "ahead left"),
        (90, "left"),
        (140, "behind left"),
        (180, "behind"),
        (-180, "behind"),
        (-130, "behind right"),
        (-90, "right"),
        (-40, "ahead right"),
    ],
)
def test_sides(degrees, side):
    assert words.side(math.radians(degrees)) == side


def test_slowed_names_rest_sensor_side_and_distance():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.7)
    feeder.all()
    verdict = feeder.decide(1.0)
    assert verdict.code == "obstacle"
    assert verdict.text == f"slowed from 1.0 to {verdict.velocity.vx:.1f} m/s: laser, 0.6 m ahead"
    assert verdict.asked == Velocity(1.0, 0.0, 0.0)
    assert (verdict.sensor, verdict.side) == (LASER, "ahead")
    assert verdict.distance_m == pytest.approx(0.632, abs=0.01)
    assert verdict.bearing_rad == pytest.approx(0.0, abs=0.1)
    assert verdict.point == pytest.approx((0.9, 0.0), abs=0.06)


def test_stopped_says_so():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.12)
    feeder.all()
    assert feeder.decide(0.5).text == "stopped (0.5 m/s asked): laser, 0.05 m ahead"
    assert feeder.decide(0.5, w=0.8).text == "turning only (0.5 m/s asked): laser, 0.05 m ahead"


def test_the_side_is_named():
    feeder = Feeder(tiago_profile())
    feeder.ranges = np.full(571, math.inf)
    feeder.ranges[285 + 155 : 285 + 166] = 0.25  # at (0.35, 0.2) in the base frame
    feeder.all()
    assert feeder.decide(1.0).text.endswith("m ahead left")


def test_a_sonar_is_named():
    feeder = Feeder(tiago_profile())
    feeder.sonar_m = 0.1
    feeder.all()
    verdict = feeder.decide(-0.2)
    assert verdict.text == "stopped (0.2 m/s asked): sonar, 0.09 m behind"
    assert verdict.sensor == "base_sonar_02_link"


def test_stopped_by_memory_says_what_to_do():
    feeder = Feeder(tiago_profile())
    for distance_m, remedy in ((0.9, False), (0.12, True)):
        feeder.ahead_at(distance_m)
        for _ in range(3):
            feeder.now_s += 0.1
            feeder.all()
        assert words.NOT_SEEN_NOW not in feeder.decide(0.5).text, "the laser sees it now"
        feeder.ranges = np.where(feeder.ranges < 2.0, math.nan, feeder.ranges)
        feeder.now_s += 0.1
        feeder.all()
        text = feeder.decide(0.9).text
        assert "laser, remembered" in text
        assert text.endswith(words.NOT_SEEN_NOW) == remedy


def test_passing_closely_differs_from_blocking():
    feeder = Feeder(tiago_profile())
    post = math.atan2(0.33, 0.3)
    beam = 285 + round(post / (math.radians(190) / 570))
    feeder.ranges = np.full(571, math.inf)
    feeder.ranges[beam - 3 : beam + 4] = math.hypot(0.33, 0.3)
    feeder.all()
    verdict = feeder.decide(1.0)
    assert verdict.code == "near_miss"
    assert "passing close, laser" in verdict.text


def test_two_lasers_are_distinguished_by_name():
    feeder = Feeder(tiago_profile(scan_poses={LASER: (0.202, 0.0, 0.0), "/scan_rear": (0.0, 0.0, math.pi)}))
    feeder.all()
    assert feeder.decide(0.5).text == "stopped: no scan of the laser /scan_rear has come yet"


def test_turning_has_words_of_its_own():
    still, turning = Velocity(0.0, 0.0, 0.0), Velocity(0.0, 0.0, -0.3)
    assert words.reduction(Velocity(0.0, 0.0, -1.0), turning) == "turning slowed from 1.0 to 0.3 rad/s"
    assert words.reduction(Velocity(0.0, 0.0, 1.0), still) == "not turning"


def test_speeds_that_look_the_same_are_named_once():
    assert words.reduction(Velocity(0.32, 0.0, 0.0), Velocity(0.28, 0.0, 0.0)) == "slowed to 0.3 m/s"
