"""The age of a picture follows from its stamp, also with a robot whose clock differs."""

import pytest

from robots.bridge.camera.picture_age import WINDOW_S, PictureAge
from robots.bridge.robot_clock import RobotClock

WALL_S = 1_800_000_000.0


def ages(skew_s, delays):
    """Ages of pictures that arrive each second with these delays, from a robot whose clock is ahead by `skew_s`."""
    age = PictureAge()
    return [
        age.on_arrival(WALL_S + second + skew_s - delay_s, WALL_S + second, float(second))
        for second, delay_s in enumerate(delays)
    ]


def test_with_equal_clocks_the_delay_is_the_age():
    assert ages(0.0, [0.04, 0.3, 0.05]) == pytest.approx([0.04, 0.3, 0.05], abs=1e-6)


@pytest.mark.parametrize("skew_s", [-3600.0, -2.0, 0.2, 5.0])
def test_with_other_clocks_only_what_grows_is_age(skew_s):
    assert ages(skew_s, [0.04, 0.34, 0.04]) == pytest.approx([0.0, 0.3, 0.0], abs=1e-6)


@pytest.mark.parametrize("skew_s", [-3600.0, 0.0, 5.0])
@pytest.mark.parametrize("delay_s", [0.8, 3.0])
def test_by_the_odometry_a_picture_that_is_always_late_is_old(skew_s, delay_s):
    age = PictureAge()
    odometry_s = skew_s - 0.01  # the odometry arrives 0.01 s late
    for second in range(5):
        wall_s = WALL_S + second
        measured_s = age.on_arrival(wall_s + skew_s - delay_s, wall_s, float(second), RobotClock(odometry_s))
    assert measured_s == pytest.approx(delay_s, abs=0.02)


def test_stamps_of_a_camera_with_a_clock_of_its_own_are_not_old():
    age = PictureAge()
    assert age.on_arrival(100.0, WALL_S, 0.0, RobotClock(-0.01)) == 0.0  # seconds since the camera's start
    assert age.on_arrival(100.7, WALL_S + 1.0, 1.0, RobotClock(-0.01)) == pytest.approx(0.3, abs=1e-6)


def test_a_clock_that_is_set_is_forgotten():
    age = PictureAge()
    age.on_arrival(WALL_S + 100.0, WALL_S, 0.0)  # the clock is 100 s ahead
    later_s = WINDOW_S + 1.0
    assert age.on_arrival(WALL_S + later_s - 0.05, WALL_S + later_s, later_s) == pytest.approx(0.05, abs=1e-6)


def test_a_picture_without_a_stamp_is_new():
    assert PictureAge().on_arrival(0.0, WALL_S, 1.0) == 0.0


@pytest.mark.parametrize("pace", [0.7, 1.5])
def test_stamps_of_a_simulated_clock_tell_no_age(pace):
    age, clock = PictureAge(), RobotClock(simulated=True)
    assert {age.on_arrival(100.0 + pace * at_s, WALL_S + at_s, at_s, clock) for at_s in range(60)} == {0.0}
