"""The page warns of reverse where nothing has looked for table tops, until somebody or something has looked."""

from __future__ import annotations

import math

import pytest

from robots.bridge.gate.obstacles.behind import LASTS_S
from robots.bridge.gate.values import Pose, Velocity
from tests.gate.conftest import Feeder, tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, Looker, camera


@pytest.fixture
def robot() -> Looker:
    """A robot that was just switched on, with its head ahead and down."""
    robot = Looker([FLOOR])
    robot.to_base = camera(LOOK_AHEAD)
    robot.stand(0.3)
    return robot


def goes(robot: Looker, x: float, yaw: float = 0.0, looks: bool = True) -> None:
    """Drive or turn to this pose in steps."""
    begin, steps = robot.pose, math.ceil(max(abs(x - robot.pose.x) / 0.02, abs(yaw - robot.pose.yaw) / 0.05))
    for step in range(1, steps + 1):
        share = step / steps
        robot.pose = Pose(begin.x + share * (x - begin.x), 0.0, begin.yaw + share * (yaw - begin.yaw))
        robot.stand(0.1, looks=looks)


def is_warned(robot: Feeder) -> bool:
    robot.all()
    return any(limit.code == "behind_unseen" for limit in robot.gate.limits(robot.now_s))


def test_a_parked_robot_is_warned_and_reverses_slowly(robot):
    assert is_warned(robot)
    [limit] = [limit for limit in robot.gate.limits(robot.now_s) if limit.code == "behind_unseen"]
    assert limit.way == "reverse" and "Turn and look" in limit.text
    assert robot.decide(vx=-0.1).velocity.vx < 0.0


def test_a_robot_backs_out_of_where_it_came_from(robot):
    goes(robot, 1.0, looks=False)
    assert not is_warned(robot)
    goes(robot, 0.5, looks=False)
    assert not is_warned(robot)
    goes(robot, 0.1, looks=False)
    assert is_warned(robot)  # behind the place where it was switched on


def test_after_a_gap_with_motion_nothing_is_known_behind(robot):
    goes(robot, 1.0, looks=False)
    robot.velocity = Velocity(0.3, 0.0, 0.0)
    robot.stand(0.1, looks=False)
    robot.now_s += 0.4
    robot.gate.observe_odometry(robot.stamp_s, robot.now_s, robot.pose, robot.velocity)
    robot._previous = robot.now_s, robot.pose
    assert is_warned(robot)


def test_a_robot_that_has_turned_and_looked_is_not_warned(robot):
    goes(robot, 0.0, math.pi)
    assert not is_warned(robot)


def test_behind_an_obstacle_nothing_was_seen():
    robot = Looker([FLOOR, ((1.3, -1.0, 0.0), (1.4, 1.0, 1.2))])
    robot.to_base = camera(LOOK_AHEAD)
    robot.stand(1.0)
    # The robot looks away from the obstacle, before it and behind it.
    assert robot.gate._behind.knows(Pose(0.5, 0.0, math.pi), robot.now_s)
    assert not robot.gate._behind.knows(Pose(1.3, 0.0, math.pi), robot.now_s)


def test_what_was_seen_grows_old(robot):
    goes(robot, 1.0)
    for _ in range(round((LASTS_S + 2.0) / 0.5)):
        robot.now_s += 0.5
        robot.all()
    assert is_warned(robot)


def test_it_forgets_with_all_other_memory(robot):
    goes(robot, 1.0)
    robot.gate.forget()
    assert is_warned(robot)


def test_without_a_depth_camera_there_is_no_warning():
    assert not is_warned(Feeder(tiago_profile()))
