"""The speed towards a goal, and the way travelled."""

import math
from collections import deque

import pytest

from robots.bridge.drive.approach import ARRIVED, Travelled, speed_towards
from robots.shared.geometry.poses import Pose

TICK_S = 0.05


def drive(goal, most, acceleration, latency_s, slowest=0.02):
    """Drive a base with this latency and acceleration to the goal; return its speeds and its way."""
    late = deque([0.0] * round(latency_s / TICK_S))
    way = speed = asked = 0.0
    speeds = []
    for _ in range(6000):
        asked = speed_towards(goal - way, asked, most, slowest, acceleration, latency_s, TICK_S)
        late.append(asked)
        change = late.popleft() - speed
        speed += max(min(change, acceleration * TICK_S), -acceleration * TICK_S)
        way += speed * TICK_S
        speeds.append(speed)
        if asked == 0.0 and speed == 0.0:
            return speeds, way
    raise AssertionError(f"not there after 300 s: {way} of {goal}")


@pytest.mark.parametrize("goal", [0.02, 0.1, 0.5, 1.0, 5.0])
@pytest.mark.parametrize("most", [0.02, 0.1, 0.4, 1.0])
@pytest.mark.parametrize("latency_s", [0.1, 0.2, 0.4])
def test_the_base_ends_at_the_goal(goal, most, latency_s):
    speeds, way = drive(goal, most, 1.0, latency_s)
    assert way == pytest.approx(goal, abs=0.02)
    assert max(speeds) <= most + 1e-9


def test_the_speed_is_a_trapezoid():
    speeds, _ = drive(5.0, 0.5, 1.0, 0.2)
    top = [number for number, speed in enumerate(speeds) if speed == pytest.approx(0.5)]
    up, down = speeds[: top[0]], speeds[top[-1] :]
    assert len(top) * TICK_S > 6.0
    assert up == sorted(up) and down == sorted(down, reverse=True)
    assert len(up) * TICK_S == pytest.approx(0.5 / 1.0 + 0.2, abs=0.1)


def test_a_short_way_is_driven_below_the_highest_speed():
    speeds, _ = drive(0.3, 1.0, 1.0, 0.2)
    assert max(speeds) < 0.4


def test_at_the_goal_and_beyond_nothing_is_asked():
    for left in (ARRIVED, 0.0, -1.0):
        assert speed_towards(left, 0.5, 0.5, 0.02, 1.0, 0.2, TICK_S) == 0.0


def test_the_distance_counts_along_the_heading_at_the_start():
    way = Travelled(Pose(1.0, 2.0, math.pi / 2))
    way.moved(Pose(1.1, 3.0, math.pi / 2))
    assert way.distance_m == pytest.approx(1.0)
    way.moved(Pose(1.0, 1.5, math.pi / 2))
    assert way.distance_m == pytest.approx(-0.5)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_angle_counts_on_beyond_half_a_turn(sign):
    way = Travelled(Pose(0.0, 0.0, 3.0))
    for step in range(1, 64):
        yaw = 3.0 + sign * 0.1 * step
        way.moved(Pose(0.0, 0.0, math.remainder(yaw, math.tau)))
    assert way.angle_rad == pytest.approx(sign * 6.3)
