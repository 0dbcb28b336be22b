"""Reverse where nothing has looked for table tops: refused, until somebody or something has looked."""

from __future__ import annotations

import math

import pytest

from robots.bridge.gate.obstacles.behind import LASTS_S, LOOKED_S
from robots.shared.geometry.poses import Pose, Velocity
from tests.gate.conftest import Feeder, tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, Looker, camera

BACK = Velocity(-0.1, 0.0, 0.0)


@pytest.fixture
def robot() -> Looker:
    """A robot that was just switched on, with its head ahead and down."""
    robot = Looker([FLOOR])
    robot.to_base = camera(LOOK_AHEAD)
    robot.stand(0.3)
    robot.decide()
    return robot


def goes(robot: Looker, x: float, yaw: float = 0.0, looks: bool = True) -> None:
    """Drive or turn to this pose in steps."""
    begin, steps = robot.pose, math.ceil(max(abs(x - robot.pose.x) / 0.02, abs(yaw - robot.pose.yaw) / 0.05))
    for step in range(1, steps + 1):
        share = step / steps
        robot.pose = Pose(begin.x + share * (x - begin.x), 0.0, begin.yaw + share * (yaw - begin.yaw))
        robot.stand(0.1, looks=looks)


def waits(robot: Looker, seconds: float) -> None:
    for _ in range(round(seconds / 0.5)):
        robot.now_s += 0.5
        robot.all()


def may_reverse(robot: Looker, w: float = 0.0) -> bool:
    """Pull back, and return whether the robot drives. The page must have said the same before."""
    robot.all()
    warned = any(limit.code == "behind_unseen" for limit in robot.gate.limits(robot.now_s))
    verdict = robot.decide(vx=-0.1, w=w)
    assert (verdict.code == "behind_unseen") == (verdict.velocity.vx == 0.0) == verdict.neutral
    assert warned or not verdict.neutral or w
    return verdict.velocity.vx < 0.0


def pulls_again(robot: Looker) -> bool:
    robot.decide()  # the stick is in the middle
    return may_reverse(robot)


def forbidden(robot: Looker, pose: Pose, velocity: Velocity = BACK) -> bool:
    """Return whether the rule would forbid this velocity at this pose, where the robot is not."""
    return robot.gate._behind.forbids(velocity, pose, robot.now_s)


def test_a_parked_robot_may_not_reverse(robot):
    assert not may_reverse(robot)
    assert not may_reverse(robot, w=0.5)  # also not on, while the stick stays there
    verdict = robot.decide(vx=-0.1)
    assert (verdict.code, verdict.way) == ("behind_unseen", "reverse")
    assert "table tops" in verdict.text and "“Turn and look”" in verdict.text and "again" in verdict.text
    assert robot.decide(w=1.0).velocity.w > 0.0 and robot.decide(vx=0.2).velocity.vx > 0.0


def test_the_second_pull_says_that_a_person_has_looked(robot):
    assert not may_reverse(robot)
    assert pulls_again(robot)
    waits(robot, LOOKED_S - 1.0)
    assert may_reverse(robot)  # each reverse prolongs it
    robot.decide()
    waits(robot, LOOKED_S + 1.0)
    assert not may_reverse(robot)
    robot.decide()
    waits(robot, LOOKED_S + 1.0)
    assert not may_reverse(robot)  # it was refused too long ago


def test_farther_on_a_person_looks_again(robot):
    assert not may_reverse(robot)
    assert pulls_again(robot)
    goes(robot, -1.3, looks=False)
    assert may_reverse(robot)
    goes(robot, -1.7, looks=False)
    assert not may_reverse(robot)


def test_a_refusal_elsewhere_is_no_look_here(robot):
    assert not may_reverse(robot)
    robot.decide()
    for place in ((0.0, math.pi), (-1.6, math.pi), (-1.6, 1.5 * math.pi)):  # within 20 s
        goes(robot, *place, looks=False)
    assert not may_reverse(robot)
    assert pulls_again(robot)


def test_after_a_quarter_turn_ahead_a_person_looks_again(robot):
    assert not may_reverse(robot)
    assert pulls_again(robot)
    goes(robot, 0.8, looks=False)
    goes(robot, 0.8, 0.5 * math.pi, looks=False)
    assert not may_reverse(robot)


def test_another_driver_has_not_looked(robot):
    assert not may_reverse(robot)
    robot.decide()
    robot.gate.observe_new_driver()
    assert not may_reverse(robot)


def test_a_robot_backs_out_of_where_it_came_from(robot):
    goes(robot, 1.0, looks=False)
    assert may_reverse(robot)
    goes(robot, 0.5, looks=False)
    assert may_reverse(robot)
    goes(robot, 0.1, looks=False)
    assert not may_reverse(robot)  # behind the place where it was switched on


def test_after_a_gap_with_motion_nothing_is_known_behind(robot):
    goes(robot, 1.0, looks=False)
    robot.velocity = Velocity(0.3, 0.0, 0.0)
    robot.stand(0.1, looks=False)
    robot.now_s += 0.4
    robot.gate.observe_odometry(robot.stamp_s, robot.now_s, robot.pose, robot.velocity)
    robot.previous = robot.now_s, robot.pose
    assert not may_reverse(robot)


@pytest.mark.parametrize(("tilt", "sees"), [(LOOK_AHEAD, True), (0.0, False), (0.5, False)])
def test_a_turn_shows_only_heights_in_the_picture(robot, tilt, sees):
    """A raised head sees no table near the robot."""
    robot.to_base = camera(tilt)
    goes(robot, 0.0, math.pi)
    assert may_reverse(robot, w=0.2) == sees


def test_a_head_that_looks_down_sees_no_table_farther_away(robot):
    robot.to_base = camera(-1.0)
    goes(robot, 0.0, math.pi)
    assert not forbidden(robot, robot.pose)
    assert forbidden(robot, Pose(-0.7, 0.0, 0.0))


@pytest.mark.parametrize("is_black", [False, True])
def test_where_the_picture_has_a_hole_nothing_was_seen(is_black):
    """The camera measures nothing of a black table top, and the laser looks below it."""
    robot = Looker([FLOOR])
    robot.black = [((0.55, -0.25, 0.7), (0.95, 0.25, 0.74))] if is_black else []
    robot.to_base = camera(LOOK_AHEAD)
    robot.stand(0.3)
    goes(robot, 0.0, math.pi, looks=False)
    assert may_reverse(robot)
    goes(robot, 0.2, math.pi, looks=False)
    assert may_reverse(robot) != is_black


def test_behind_an_obstacle_nothing_was_seen():
    robot = Looker([FLOOR, ((1.3, -1.0, 0.0), (1.4, 1.0, 1.2))])
    robot.to_base = camera(LOOK_AHEAD)
    robot.stand(1.0)
    # The robot looks away from the obstacle, before it and behind it.
    assert not forbidden(robot, Pose(0.6, 0.0, math.pi))
    assert forbidden(robot, Pose(1.3, 0.0, math.pi))


def test_a_fast_robot_needs_a_longer_known_way(robot):
    robot.stand(0.3)
    away = Pose(1.0, 0.0, math.pi)  # 1 m of seen floor behind it
    assert not forbidden(robot, away)
    assert forbidden(robot, away, Velocity(-1.0, 0.0, 0.0))


def test_what_was_seen_grows_old(robot):
    goes(robot, 1.0)
    waits(robot, LASTS_S + 2.0)
    assert not may_reverse(robot)


def test_it_forgets_with_all_other_memory(robot):
    goes(robot, 1.0)
    robot.gate.forget()
    assert not may_reverse(robot)


def test_an_obstacle_that_holds_the_robot_is_named_first(robot):
    robot.sonar_m = 0.05
    waits(robot, 1.0)
    verdict = robot.decide(vx=-0.1)
    assert (verdict.code, verdict.neutral) == ("obstacle", False)


def test_without_a_depth_camera_the_rule_does_not_apply():
    robot = Feeder(tiago_profile())
    robot.all()
    robot.decide()
    assert may_reverse(robot)
