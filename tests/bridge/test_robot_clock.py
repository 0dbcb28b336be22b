"""The age of a stamp by the robot's clock, where it means something."""

from __future__ import annotations

import pytest

from robots.bridge.robot_clock import RobotClock

WALL_S = 1_795_899_000.0


@pytest.mark.parametrize("skew_s", [0.0, 3600.0, -3600.0, 2.0, -WALL_S + 500.0])
def test_an_age_is_by_the_robots_clock(skew_s):
    clock = RobotClock(skew_s)
    assert clock.age_s(WALL_S + skew_s - 1.5, WALL_S) == pytest.approx(1.5, abs=1e-3)
    assert clock.age_s(WALL_S + skew_s + 0.2, WALL_S) == 0.0  # it is newer than the odometry


@pytest.mark.parametrize(
    ("clock", "stamp_s"),
    [
        (RobotClock(), 0.0),
        (RobotClock(), 4_000.0),  # seconds since a driver's start
        (RobotClock(), WALL_S + 3600.0),
        (RobotClock(-3600.0), WALL_S),
        (RobotClock(simulated=True), WALL_S - 1.0),
        (RobotClock(simulated=True), 4_000.0),
    ],
)
def test_an_age_that_means_nothing_is_not_told(clock, stamp_s):
    assert clock.age_s(stamp_s, WALL_S) is None
