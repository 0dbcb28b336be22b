"""Old or missing data: slower, then stop, then neutral stick. A wrong clock does not count as old data."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.sensor_limits import late_share
from robots.bridge.gate.timing.freshness import Freshness
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import SpeedLimit
from tests.gate.conftest import LASER, SONARS, Feeder, tiago_profile


def test_with_everything_fresh_nothing_is_taken_away(tiago):
    verdict = tiago.decide(0.8, w=0.5)
    assert (verdict.code, verdict.velocity) == ("free", Velocity(0.8, 0.0, 0.5))
    assert not verdict.neutral and verdict.text == "" and verdict.limits == ()


@pytest.mark.parametrize("left_out", ["odometry", "scan"])
def test_missing_data_stops_the_robot_and_asks_for_neutral(left_out):
    feeder = Feeder(tiago_profile())
    feeder.sonars()
    feeder.scan() if left_out == "odometry" else feeder.odometry()
    verdict = feeder.decide(0.5, w=0.5)
    assert (verdict.velocity, verdict.code) == (STILL, f"{left_out}_missing")
    assert verdict.neutral
    assert "has come yet" in verdict.text


def test_a_late_laser_slows_to_zero_then_needs_neutral(tiago):
    speeds = []
    for _ in range(60):
        tiago.now_s += 0.01
        tiago.odometry()
        speeds.append(tiago.decide(1.0).velocity.vx)
    assert speeds[20] == pytest.approx(1.0), "a 10 Hz laser may miss one scan"
    assert 0.0 < speeds[25] < speeds[23] < 1.0
    assert speeds[28] == speeds[59] == 0.0
    verdict = tiago.decide(1.0)
    assert (verdict.code, verdict.sensor, verdict.neutral) == ("scan_stale", LASER, True)
    assert verdict.text == "stopped: laser is 0.6 s old"


def test_while_it_slows_for_a_late_laser_the_words_say_so(tiago):
    tiago.now_s += 0.25
    tiago.odometry()
    verdict = tiago.decide(1.0)
    assert (verdict.code, verdict.neutral) == ("scan_late", False)
    assert verdict.text == "slowed from 1.0 to 0.5 m/s: laser is 0.2 s old"


def test_a_laser_back_within_half_a_second_needs_no_neutral(tiago):
    tiago.now_s += 0.40
    tiago.odometry()
    verdict = tiago.decide(1.0)
    assert (verdict.velocity, verdict.code, verdict.neutral) == (STILL, "scan_late", False)
    assert verdict.text == "stopped (1.0 m/s asked): laser is 0.4 s old"
    tiago.scan()
    assert tiago.decide(1.0).code == "free"


def test_late_share_falls_from_all_to_nothing():
    assert [late_share(age) for age in (0.0, 0.22, 0.25, 0.28, 9.0)] == pytest.approx(
        [1.0, 1.0, 0.5, 0.0, 0.0]
    )


def test_odometry_older_than_a_fifth_of_a_second_stops(tiago):
    tiago.now_s += 0.19
    tiago.scan()
    assert tiago.decide(0.5).code == "free"
    tiago.now_s += 0.02
    verdict = tiago.decide(0.5)
    assert (verdict.velocity, verdict.code, verdict.neutral) == (STILL, "odometry_stale", True)
    assert verdict.text == "stopped: odometry is 0.2 s old"


def test_silent_sonars_limit_reverse_only(tiago):
    tiago.now_s += 0.6
    tiago.odometry()
    tiago.scan()
    verdict = tiago.decide(-0.2)
    assert verdict.velocity.vx == pytest.approx(-0.1)
    assert verdict.code == "sonar_stale"
    assert "in reverse" in verdict.text and "base_sonar_01_link" in verdict.text
    assert verdict.limits == (SpeedLimit("sonar_stale", verdict.text, 0.1, "reverse"),)
    assert verdict.way == "reverse"
    assert tiago.decide(0.9).velocity.vx == 0.9


def test_one_silent_sonar_of_three_is_enough_to_hold_reverse(tiago):
    tiago.now_s += 0.6
    tiago.odometry()
    tiago.scan()
    for name in list(SONARS)[:2]:
        tiago.gate.observe_range(name, tiago.stamp_s, tiago.now_s, math.inf, 1.0)
    verdict = tiago.decide(-0.2)
    assert verdict.velocity.vx == pytest.approx(-0.1)
    assert "base_sonar_03_link" in verdict.text and "base_sonar_01_link" not in verdict.text


@pytest.mark.parametrize(
    ("dead", "code", "wait_s"), [("odometry", "odometry_stale", 0.3), ("scan", "scan_stale", 0.6)]
)
def test_a_frozen_stamp_is_stale_however_often_it_arrives(tiago, dead, code, wait_s):
    frozen_s = tiago.stamp_s
    for _ in range(round(wait_s / 0.02)):
        tiago.now_s += 0.02
        if dead == "odometry":
            tiago.gate.observe_odometry(frozen_s, tiago.now_s, Pose(0, 0, 0), STILL)
            tiago.scan()
        else:
            tiago.scan(stamp_s=frozen_s)
            tiago.odometry()
    assert tiago.decide(0.5).code == code


def test_a_sonar_with_a_frozen_stamp_is_silent(tiago):
    frozen_s = tiago.stamp_s
    for _ in range(8):
        tiago.now_s += 0.1
        tiago.odometry()
        tiago.scan()
        for name in SONARS:
            tiago.gate.observe_range(name, frozen_s, tiago.now_s, math.inf, 1.0)
    assert tiago.decide(-0.2).code == "sonar_stale"


@pytest.mark.parametrize("hours", [-1, 1, 24 * 365])
def test_a_robot_whose_clock_is_hours_off_is_not_stale(hours):
    feeder = Feeder(tiago_profile(), clock_offset_s=3600.0 * hours)
    for _ in range(20):
        feeder.now_s += 0.1
        feeder.all()
    assert feeder.decide(0.9).code == "free"


@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 3600.0])
def test_a_set_robot_clock_costs_at_most_a_neutral_stick(tiago, step_s):
    tiago.clock_offset_s = step_s
    for tick in range(12):
        tiago.now_s += 0.05
        tiago.all()
        verdict = tiago.decide(0.9)
        if tick == 0 and step_s < 0.0:
            assert (verdict.velocity, verdict.code, verdict.neutral) == (STILL, "odometry_anew", True)
            tiago.decide()
        else:
            assert verdict.code == "free"


def test_a_late_message_of_before_is_not_news(tiago):
    tiago.now_s += 0.1
    tiago.all()
    tiago.gate.observe_odometry(tiago.stamp_s - 0.08, tiago.now_s, Pose(9.0, 9.0, 0.0), STILL)
    tiago.ahead_at(0.5)
    tiago.scan(stamp_s=tiago.stamp_s - 0.08)
    assert tiago.decide(0.9).code == "free"


def test_a_scan_whose_stamps_do_not_match_the_odometry_stops(tiago):
    tiago.now_s += 0.1
    tiago.odometry()
    tiago.scan(stamp_s=tiago.stamp_s + 5.0)
    verdict = tiago.decide(0.5)
    assert (verdict.code, verdict.neutral) == ("scan_unpaired", True)
    [laser] = [sensor for sensor in tiago.gate.sensor_health(tiago.now_s) if sensor.kind == "scan"]
    assert not laser.ok and "stamps" in laser.text


def test_an_idle_robot_needs_no_neutral(tiago):
    tiago.now_s += 60.0
    verdict = tiago.decide()
    assert (verdict.code, verdict.velocity, verdict.neutral) == ("idle", STILL, False)


def test_health_lists_each_sensor_with_age_and_fault(tiago):
    assert all(sensor.ok and not sensor.text for sensor in tiago.gate.sensor_health(tiago.now_s))
    tiago.now_s += 0.7
    tiago.odometry()
    health = {sensor.name: sensor for sensor in tiago.gate.sensor_health(tiago.now_s)}
    assert set(health) == {"odometry", LASER, *SONARS}
    assert health["odometry"].ok and health["odometry"].age_s == 0.0
    assert not health[LASER].ok and health[LASER].text == "nothing new for 0.7 s"
    assert {health[name].kind for name in SONARS} == {"sonar"}
    fresh = {sensor.name: sensor for sensor in Feeder(tiago_profile()).gate.sensor_health(5.0)}
    assert fresh[LASER].age_s is None and fresh[LASER].text == "nothing has come yet"


def test_standstill_needs_fresh_odometry_that_says_so(tiago):
    assert tiago.gate.standstill(tiago.now_s)
    assert not tiago.gate.standstill(tiago.now_s + 0.3)
    tiago.velocity = Velocity(0.0, 0.0, 0.1)
    tiago.now_s += 0.02
    tiago.odometry()
    assert not tiago.gate.standstill(tiago.now_s)


def test_a_robot_whose_speed_only_trembles_stands():
    """The velocity is the difference of poses with 2 mm and 2 mrad of noise: 0.14 m/s in single messages."""
    gate, random = Gate(tiago_profile()), np.random.default_rng(0)
    before, stood = np.zeros(3), []
    for step in range(3000):  # 60 s at 50 Hz
        now_s = 100.0 + 0.02 * step
        pose = random.normal(0.0, 0.002, 3)
        gate.observe_odometry(now_s, now_s, Pose(*pose), Velocity(*((pose - before) / 0.02)))
        before = pose
        stood.append(gate.standstill(now_s))
    assert not any(stood[1:20]), "not known at once"
    assert all(stood[100:])


@pytest.mark.parametrize("tremble_m", [0.0, 0.002])
@pytest.mark.parametrize(
    "twist", [Velocity(0.02, 0.0, 0.0), Velocity(-0.02, 0.0, 0.0), Velocity(0.0, 0.0, 0.03)]
)
def test_a_slow_robot_does_not_stand(twist, tremble_m):
    gate, random = Gate(tiago_profile()), np.random.default_rng(0)
    before, stood = np.zeros(3), []
    for step in range(1000):
        now_s = 100.0 + 0.02 * step
        moved_s = max(0.0, 0.02 * step - 2.0)
        pose = np.array((twist.vx * moved_s, 0.0, twist.w * moved_s)) + random.normal(0.0, tremble_m, 3)
        gate.observe_odometry(now_s, now_s, Pose(*pose), Velocity(*((pose - before) / 0.02)))
        before = pose
        stood.append(gate.standstill(now_s))
    assert all(stood[75:100])
    late = 125 if tremble_m else 101
    assert not any(stood[late:]) if not tremble_m else sum(stood[late:]) <= 5


def test_a_clock_set_back_a_little_is_followed_after_three_messages():
    """A time server may step a clock during a drive."""
    freshness = Freshness()
    assert [freshness.advances(100.0 + 0.02 * n, 0.02 * n) for n in range(5)] == [True] * 5
    assert [freshness.advances(99.7 + 0.02 * n, 0.1 + 0.02 * n) for n in range(6)] == [False] * 2 + [True] * 4
    assert freshness.within(0.05, 0.2)


@pytest.mark.parametrize(
    "stamps", [[100.0] * 20, [99.9, 99.8, 99.9, 99.7] * 5, [99.9, 100.0] * 10, [0.0] * 20]
)
def test_stamps_that_do_not_advance_are_stale(stamps):
    freshness = Freshness()
    freshness.advances(stamps[0], 0.0)
    freshness.advances(max(stamps), 0.0)
    for number, stamp_s in enumerate(stamps, 1):
        assert not freshness.advances(stamp_s, number * 0.05)
    assert freshness.silence(0.5, 1.0) == "messages come, but their stamps do not advance"
    assert freshness.silence(0.5, 9.0) == "nothing new for 9.0 s"


def test_a_clock_stepped_during_a_drive_makes_no_robot_late(tiago):
    for stepped_s in (-0.4, 0.4, -30.0, 30.0):
        tiago.clock_offset_s += stepped_s
        for number in range(100):
            tiago.now_s += 0.02
            tiago.odometry()
            if number % 5 == 0:
                tiago.scan()
        assert tiago.gate.latency.lateness_s(tiago.now_s) < 0.1
