"""After a restart of the robot or a break in odometry, the gate forgets earlier obstacles and measurements."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.arm.discs import AT_HOME
from robots.bridge.gate.values import Forgotten
from robots.shared.geometry.poses import STILL, Pose
from tests.gate.conftest import SONARS, Feeder, tiago_profile


@pytest.fixture
def haunted() -> Feeder:
    """A TIAGo that remembers an obstacle 0.3 m to its right and behind, out of its laser's view."""
    feeder = Feeder(tiago_profile(has_arm=True))
    feeder.gate.observe_posture(AT_HOME, feeder.now_s)
    feeder.sonar_m = 0.3
    feeder.pose = Pose(0.0, 0.0, math.radians(-30))
    feeder.ranges[5:130] = 0.6
    for yaw in (-30.0, 0.0, 30.0):
        feeder.pose = Pose(0.0, 0.0, math.radians(yaw))
        for _ in range(10):
            feeder.now_s += 0.05
            feeder.all()
        feeder.ranges = np.full(571, math.inf)
    return feeder


def known(feeder: Feeder) -> dict[str, int]:
    """Number of points of each source."""
    obstacles = feeder.gate.obstacles(feeder.now_s)
    counts = np.bincount(obstacles.source, minlength=len(obstacles.names))
    return {name: count for name, count in zip(obstacles.names, counts.tolist(), strict=True) if count}


@pytest.mark.parametrize(
    ("silent_s", "clock_s", "x", "run", "code"),
    [
        (10.0, 0.0, 20.0, 0, "jump"),
        (0.05, 0.0, 0.0, 1, "odometry_restarted"),  # another publisher, or a restarted master
        (2.0, 0.0, 0.0, 1, "odometry_restarted"),
        (0.05, -2.0, 0.0, 0, "stamps_back"),
        (3.0, -2.0, 0.0, 0, "stamps_back"),
        (0.05, 0.0, 1.0, 0, "jump"),
        (2.0, 0.0, 1.0, 0, "jump"),  # nothing moved it so far
    ],
)
def test_a_restart_of_odometry_clears_the_memory(haunted, silent_s, clock_s, x, run, code):
    gate = haunted.gate
    assert known(haunted)["/scan_raw, remembered"] > 10
    assert gate.forgotten is None
    gate.latency._in_force_s = 0.6  # measured under load
    haunted.decide()
    haunted.now_s += silent_s
    pose = haunted.pose._replace(x=x)
    if run:
        gate.forget(restarted=True, code="odometry_restarted")
    gate.observe_odometry(haunted.now_s + clock_s - (10.0 if clock_s else 0.0), haunted.now_s, pose, STILL)
    assert known(haunted) == {}
    assert gate.forgotten == Forgotten(1, code)
    assert gate.latency.in_force_s(haunted.now_s) == pytest.approx(0.2)
    haunted.clock_offset_s = clock_s - (10.0 if clock_s else 0.0)
    haunted.scan()
    verdict = haunted.decide(0.5)
    assert (verdict.velocity, verdict.code, verdict.neutral) == (STILL, "odometry_anew", True)
    assert verdict.text == "stopped: the robot’s odometry restarted"
    assert any(hold.code == "arm_away" for hold in verdict.limits), "where the arm is nobody told yet"
    haunted.decide()
    gate.observe_posture(AT_HOME, haunted.now_s)
    assert haunted.decide(0.5).code == "free"


@pytest.mark.parametrize(
    ("silent_s", "clock_s"),
    [
        (0.29, 0.0),
        (0.38, 0.0),
        (5.0, 0.0),
        (0.05, 3600.0),  # the clock is set forward
        (2.0, 3600.0),
        (60.0, -59.95),  # a paused simulator: its time goes on where it stopped
    ],
)
def test_a_gap_a_pause_or_a_set_clock_forgets_nothing(haunted, silent_s, clock_s):
    gate, then_s = haunted.gate, haunted.now_s
    before = haunted.laser_memory.points(then_s)
    haunted.now_s += silent_s
    gate.observe_odometry(haunted.now_s + clock_s, haunted.now_s, haunted.pose, STILL)
    haunted.previous = haunted.now_s, haunted.pose
    assert gate.forgotten is None and haunted.resets == 0
    assert len(haunted.laser_memory.points(then_s)) == len(before)  # later, they may be too old
    haunted.decide()
    haunted.clock_offset_s = clock_s
    haunted.all()
    assert haunted.decide(0.1).code != "odometry_anew"


def test_nothing_is_said_when_nothing_was_remembered(tiago):
    tiago.gate.forget(restarted=True, code="odometry_restarted")
    assert tiago.gate.forgotten is None


def test_a_burst_after_a_delay_leaves_no_hole(haunted):
    before = known(haunted)["/scan_raw, remembered"]
    for late_s in np.arange(0.02, 1.0, 0.02):
        stamp_s = haunted.now_s + late_s
        haunted.gate.observe_odometry(stamp_s, haunted.now_s + 1.0, haunted.pose, STILL)
    haunted.now_s += 1.0
    haunted.scan()
    assert known(haunted)["/scan_raw, remembered"] == pytest.approx(before, abs=2)


def test_current_sensor_data_is_not_forgotten(haunted):
    haunted.ahead_at(1.0)
    haunted.now_s += 0.05
    haunted.all()
    before = known(haunted)
    haunted.gate.forget()
    left = known(haunted)
    assert "/scan_raw, remembered" in before and "/scan_raw, remembered" not in left
    assert left["/scan_raw"] == before["/scan_raw"]
    assert all(left[name] > 0 for name in SONARS)
    assert haunted.decide(0.1).code == "free", "no restart: the stick need not return to the middle"
