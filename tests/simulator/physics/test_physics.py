"""The body follows its commands and stops at obstacles."""

from __future__ import annotations

import math

import pytest

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.worlds import Box, Person, Table
from tests.simulator.conftest import room

RADIUS_M = 0.27


def test_it_drives_straight(robot_in):
    driven = robot_in(room())
    driven.drive(Twist(0.5), 2.0)
    x, y, yaw = driven.robot.physics.pose
    assert x == pytest.approx(0.5 * 2.0 - 0.5**2 / 2.0, abs=0.01), "less what accelerating took"
    assert (y, yaw) == pytest.approx((0.0, 0.0), abs=0.001)


def test_it_turns_on_the_spot(robot_in):
    driven = robot_in(room())
    driven.drive(Twist(w=1.0), 1.0)
    assert driven.robot.physics.velocity.w == pytest.approx(1.0, abs=0.01)
    assert math.hypot(*driven.robot.physics.pose[:2]) < 0.001


def test_it_drives_an_arc(robot_in):
    driven = robot_in(room())
    driven.drive(Twist(0.3, 0.0, 0.6), math.tau / 0.6 + 0.25)
    assert math.hypot(*driven.robot.physics.pose[:2]) < 0.15, "a full circle of half a metre leads back"


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_wall_stops_the_robot_and_is_reported(robot_in, speed):
    driven = robot_in(room())
    driven.drive(Twist(speed), 12.0)
    assert driven.robot.physics.pose.x == pytest.approx(2.0 - RADIUS_M, abs=0.01)
    assert driven.robot.physics.velocity.vx == pytest.approx(0.0, abs=0.001)
    assert {contact.other for contact in driven.robot.physics.contacts()} == {"east wall"}
    assert driven.robot.physics.clearance_m() == pytest.approx(0.0, abs=0.005)


def test_clearance_is_the_gap_to_the_nearest_thing(robot_in):
    world = room(boxes=[Box(name="box", at=(1.0, 0.0), size=(0.2, 0.2, 0.5))])
    assert robot_in(world).robot.physics.clearance_m() == pytest.approx(0.9 - RADIUS_M, abs=0.001)


def test_a_table_top_stops_the_upper_body(robot_in):
    world = room(tables=[Table(name="desk", at=(1.0, 0.0), size=(0.8, 1.6), legs=False)])
    driven = robot_in(world)
    driven.drive(Twist(0.3), 5.0)
    contacts = driven.robot.physics.contacts()
    assert {contact.other for contact in contacts} == {"desk top"}
    assert "robot base" not in {contact.part for contact in contacts}


def test_a_base_without_upper_body_passes_below(robot_in):
    world = room(tables=[Table(name="desk", at=(1.0, 0.0), size=(0.8, 1.6), legs=False)])
    driven = robot_in(world, base="pmb2")
    driven.drive(Twist(0.3), 5.0)
    assert driven.robot.physics.pose.x > 1.0
    assert not driven.robot.physics.contacts()


def test_a_doorway_of_eighty_centimetres_lets_it_through(robot_in):
    world = room(
        boxes=[
            Box(name="left post", at=(0.0, 1.2), size=(0.1, 1.6, 2.0)),
            Box(name="right post", at=(0.0, -1.2), size=(0.1, 1.6, 2.0)),
        ]
    )
    driven = robot_in(world, Pose(-1.0, 0.0, 0.0))
    driven.drive(Twist(0.5), 4.5)
    assert driven.robot.physics.pose.x > 0.9


def test_a_person_walking_into_the_robot_is_reported(robot_in):
    person = Person(name="visitor", at=(1.5, 0.0), path=[(1.5, 0.0), (-1.5, 0.0)], walks=True)
    driven = robot_in(room(people=[person]))
    for _ in range(200):
        driven.wait(0.02)
        if contacts := driven.robot.physics.contacts():
            break
    assert {contact.other.split()[0] for contact in contacts} == {"visitor"}


def test_a_holonomic_base_moves_sideways(robot_in):
    driven = robot_in(room(), base="generic_omni")
    driven.drive(Twist(0.0, 0.3), 2.0)
    assert driven.robot.physics.pose.y > 0.3
    assert driven.robot.odometry.y == pytest.approx(driven.robot.physics.pose.y, abs=0.02)
