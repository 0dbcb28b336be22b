"""The simulated robot's map of its world, and the robot's estimated place on the map."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.sensors.localisation import SIGMA_M
from robots.simulator.sensors.odometry import Drift
from robots.simulator.sensors.survey import FREE, OCCUPIED, RESOLUTION_M, UNKNOWN, surveyed
from robots.simulator.worlds import Box, Chair, Person, Table
from tests.simulator.conftest import ORIGIN, room

HEIGHT_M = 0.0945


@pytest.fixture
def at(robot_in):
    """`at(**things)(x, y)`: the cell at (x, y) in the map of a room with these things."""

    def of_room(pose=ORIGIN, **things):
        world = room(**things)
        survey = surveyed(robot_in(world, pose).robot.physics, world.size, HEIGHT_M)

        def cell(x, y):
            row, column = (y - survey.south_m) / RESOLUTION_M, (x - survey.west_m) / RESOLUTION_M
            return int(survey.cells[math.floor(row), math.floor(column)])

        return cell

    return of_room


def test_floor_is_free_wall_faces_occupied_behind_unknown(at):
    cell = at()
    assert cell(0.0, 0.0) == cell(1.98, -1.98) == FREE
    assert cell(2.02, 0.5) == cell(-2.02, 0.5) == cell(0.5, 2.02) == OCCUPIED
    assert cell(2.08, 0.5) == cell(2.7, 0.5) == UNKNOWN


def test_the_map_has_furniture_at_the_lasers_height(at):
    cell = at(
        tables=[Table("table", (1.0, 1.0), (1.0, 0.6))],
        chairs=[Chair("chair", (-1.0, 1.0))],
        boxes=[
            Box("cupboard", (-1.0, -1.0), (0.6, 0.4, 1.8), yaw=90.0),
            Box("wall board", (1.0, -1.0), (0.5, 0.5, 0.1), z=0.5),
        ],
        people=[Person("person", (0.0, 1.2))],
    )
    assert cell(1.0, 1.0) == FREE  # below the top
    assert cell(1.45, 1.25) == cell(0.55, 0.75) == OCCUPIED  # the table's legs
    assert cell(-1.0, 1.0) == FREE
    assert cell(-0.803, 1.197) == OCCUPIED  # the chair's leg, 2.5 cm thick
    assert cell(-1.0, -1.0) == UNKNOWN
    assert cell(-1.18, -1.0) == cell(-1.0, -1.28) == OCCUPIED  # turned: 0.4 m wide, 0.6 m long
    assert cell(-1.23, -1.0) == FREE
    assert cell(1.0, -1.0) == FREE  # above the laser
    assert cell(0.0, 1.2) == FREE  # people are not mapped


def test_a_room_where_the_robot_cannot_get_to_is_unknown(at):
    partition = [Box("partition", (0.0, 1.0), (4.2, 0.1, 2.0))]
    south = at(boxes=partition)
    assert (south(0.0, 0.0), south(0.0, 1.5), south(1.5, 0.97)) == (FREE, UNKNOWN, OCCUPIED)
    north = at(Pose(0.0, 1.5, 0.0), boxes=partition)
    assert (north(0.0, 0.0), north(0.0, 1.5)) == (UNKNOWN, FREE)


def test_odometry_drifts_and_its_map_pose_corrects_it(robot_in):
    driven = robot_in(room(), Pose(-1.0, -0.5, 1.0), drift=Drift().times(10.0))
    robot = driven.robot

    def believed():
        """The robot's place on the map, by odometry and the pose of the odometry frame."""
        x, y, yaw = robot.localisation.map_to_odom(robot.physics.pose)
        measured = robot.odometry
        c, s = math.cos(yaw), math.sin(yaw)
        return x + c * measured.x - s * measured.y, y + s * measured.x + c * measured.y, yaw + measured.yaw

    def error():
        return math.dist(believed()[:2], robot.physics.pose[:2])

    assert error() < 5 * SIGMA_M
    for twist in (Twist(0.5), Twist(0.0, 0.0, 1.0), Twist(0.5), Twist(0.0, 0.0, -1.0)) * 2:
        driven.drive(twist, 1.5)
    assert math.dist((robot.odometry.x, robot.odometry.y), (0.0, 0.0)) > 0.0
    assert error() < 5 * SIGMA_M
    turned = believed()[2] - robot.physics.pose.yaw
    assert math.remainder(turned, math.tau) == pytest.approx(0.0, abs=0.05)


def test_a_robot_that_stands_believes_the_same_all_the_time(robot_in):
    robot = robot_in(room()).robot
    before = robot.localisation.map_to_odom(robot.physics.pose)
    assert {robot.localisation.map_to_odom(robot.physics.pose) for _ in range(20)} == {before}
    assert np.isfinite(before).all()


def test_a_lost_robot_believes_nothing_before_its_pose_is_set(robot_in):
    robot = robot_in(room()).robot
    robot.localisation.waits = True
    assert robot.believed() is None
    robot.localisation.give(Pose(0.3, 0.2, 0.1), robot.physics.pose)
    assert robot.believed() == pytest.approx((0.3, 0.2, 0.1))
