"""Following a path, and the turn at its end."""

from __future__ import annotations

import math

from robots.simulator.navigation.follower import LEFT_M, THERE_M, THERE_RAD, follow, is_there
from robots.simulator.physics.mujoco_world import Pose

PATH = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]


def twist(pose: Pose, heading: float = 0.0, *, there: bool):
    return follow(PATH, heading, pose, 1.0, there)


def test_a_robot_that_is_shifted_while_it_turns_at_its_goal_turns_on():
    at, shifted = Pose(1.0 - THERE_M + 0.005, 0.0, 2.0), Pose(1.0 - THERE_M - 0.015, 0.0, 2.0)
    assert is_there(PATH, at, was_there=False) and not is_there(PATH, shifted, was_there=False)
    assert is_there(PATH, shifted, was_there=True)
    turns = [twist(pose, math.pi, there=True) for pose in (at, shifted)]
    assert turns[0] == turns[1] and turns[0].vx == 0.0 and turns[0].w > 0.0
    assert twist(shifted, math.pi, there=False).w < 0.0  # back to the goal: it would turn back and forth


def test_a_robot_that_was_pushed_away_drives_back():
    away = Pose(1.0 - LEFT_M - 0.01, 0.0, 0.0)
    assert not is_there(PATH, away, was_there=True)
    assert twist(away, math.pi, there=False).vx > 0.0


def test_it_has_arrived_with_the_right_heading():
    assert twist(Pose(1.0, 0.0, THERE_RAD / 2.0), there=True) is None
