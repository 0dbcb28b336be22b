"""Positions and velocities in /joint_states belong together."""

from __future__ import annotations

import math

import pytest

from robots.simulator.physics.base import Twist
from robots.simulator.physics.wheels import LEFT, RIGHT
from tests.simulator.conftest import room


@pytest.mark.parametrize("base", ["tiago", "pmb2"])
def test_wheels_roll_as_far_as_the_base_drives(robot_in, base):
    driven = robot_in(room(), base=base)
    driven.drive(Twist(0.4, 0.0, 0.0), 1.0)
    joints = driven.robot.joints()
    for wheel in (LEFT, RIGHT):
        position, velocity = joints[wheel]
        assert position == pytest.approx(driven.robot.physics.pose.x / 0.0985, rel=0.02)
        assert velocity == pytest.approx(0.4 / 0.0985, rel=0.02)


def test_wheels_roll_against_each_other_in_a_turn(robot_in):
    driven = robot_in(room())
    driven.drive(Twist(0.0, 0.0, 1.0), 1.0)
    joints = driven.robot.joints()
    turned = driven.robot.physics.pose.yaw * 0.4044 / 2.0 / 0.0985
    assert joints[RIGHT][0] == pytest.approx(turned, rel=0.02)
    assert joints[LEFT][0] == pytest.approx(-turned, rel=0.02)


def test_velocities_add_up_to_the_way_of_the_joints(robot_in):
    driven = robot_in(room())
    robot = driven.robot
    driven.wait(0.1)
    robot.player.start("head_tour", driven.now)
    begin, way = robot.joints()["head_1_joint"][0], 0.0
    for _ in range(50):
        driven.wait(0.02)
        way += robot.joints()["head_1_joint"][1] * 0.02
    assert way == pytest.approx(robot.joints()["head_1_joint"][0] - begin, abs=1e-6)
    assert abs(way) > 0.3


def test_joints_that_stand_have_no_velocity(robot_in):
    driven = robot_in(room())
    driven.robot.player.start("open", driven.now)
    driven.wait(3.0)
    assert all(math.isclose(speed, 0.0, abs_tol=1e-3) for _, speed in driven.robot.joints().values())


def test_a_base_without_known_wheels_publishes_no_joints(robot_in):
    assert robot_in(room(), base="generic_omni").robot.joints() == {}
