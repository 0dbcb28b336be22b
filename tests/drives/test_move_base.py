"""The simulated robot's own navigation: through doors, around things not on the map, and its failures."""

from __future__ import annotations

import math

import pytest

from robots.simulator.faults import Faults
from robots.simulator.navigation.navigator import NO_CONTROL, NO_PLAN, REACHED, GoalDrive, Navigator, Phase
from robots.simulator.navigation.planner import CostMap
from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import TICK_S, Robot
from robots.simulator.sensors.body import BODIES
from robots.simulator.sensors.odometry import Drift
from robots.simulator.sensors.survey import surveyed
from robots.simulator.worlds import load_world
from tests.simulator.conftest import room

HALL, OFFICE, MEETING = Pose(2.0, 1.8, 0.0), Pose(7.5, 5.0, 0.0), Pose(1.2, 5.5, math.pi / 2)


def drive(robot: Robot, goal: Pose, seconds: float = 90.0, room_m: float = 0.0) -> GoalDrive:
    """Drive until the goal ends; nothing may be nearer than `room_m` on the way."""
    navigator = Navigator(robot)
    now = 0.0
    driven = navigator.go(goal, now)
    while driven.phase is Phase.DRIVING and now < seconds:
        if (twist := navigator.step(now)) is not None:
            robot.command(twist, now)
        robot.tick(now)
        now += TICK_S
        assert not robot.physics.contacts()
        assert not room_m or robot.physics.clearance_m(room_m) >= room_m
    return driven


@pytest.fixture
def office() -> Robot:
    return Robot(load_world("office"), BODIES["tiago"], HALL, 1, Drift())


@pytest.mark.parametrize("goal", [OFFICE, MEETING])
def test_it_drives_through_a_door_to_the_goal(office, goal):
    driven = drive(office, goal)
    assert (driven.phase, driven.text) == (Phase.REACHED, REACHED)
    truth = office.physics.pose
    assert math.dist(truth[:2], goal[:2]) < 0.2
    assert abs(math.remainder(truth.yaw - goal.yaw, math.tau)) < 0.2


def test_it_goes_around_a_person_who_is_not_on_the_map(office):
    office.people["person"].x, office.people["person"].y = 4.5, 1.8
    assert drive(office, Pose(7.0, 1.8, 0.0)).phase is Phase.REACHED


@pytest.mark.parametrize("at", [(4.5, 1.8), (4.5, 2.2)])
def test_it_keeps_away_from_a_trunk_that_is_wider_than_the_legs(office, at):
    office.people["person"].x, office.people["person"].y = at
    assert drive(office, Pose(7.0, 1.8, 0.0), room_m=0.15).phase is Phase.REACHED


def test_a_goal_without_a_way_fails_at_once(office):
    driven = drive(office, Pose(20.0, 0.7, 0.0))
    assert (driven.phase, driven.text) == (Phase.FAILED, NO_PLAN)


def test_it_gives_up_where_the_way_stays_barred(robot_in):
    world = load_world("office")
    robot = robot_in(world, HALL).robot
    robot.people["person"].x, robot.people["person"].y = 7.55, 3.5  # in the door
    driven = drive(robot, Pose(7.55, 4.4, math.pi / 2))
    assert (driven.phase, driven.text) == (Phase.FAILED, NO_CONTROL)


def test_it_plans_nothing_while_it_does_not_know_where_it_is(office):
    office.faults = Faults(localisation_dead=True)
    assert drive(office, OFFICE).text == NO_PLAN


def test_a_path_keeps_away_from_walls(robot_in):
    world = room()
    driven = robot_in(world, Pose(-1.5, 0.0, 0.0))
    costs = CostMap(surveyed(driven.robot.physics, world.size, 0.0945), 0.3)
    path = costs.plan((-1.6, 1.6), (1.6, 1.6))
    assert (path[0], path[-1]) == ((-1.6, 1.6), (1.6, 1.6))
    assert min(y for _, y in path) < 1.5, "a straight line would stay 0.4 m from the wall"
    assert costs.plan((0.0, 0.0), (2.6, 0.0)) == []


@pytest.mark.parametrize(("off_m", "is_lost"), [(0.5, False), (1.2, True)])
def test_a_pose_that_a_person_sets_is_believed(robot_in, off_m, is_lost):
    driven = robot_in(room())
    robot = driven.robot
    robot.localisation.give(Pose(off_m, 0.0, 0.0), robot.physics.pose)
    assert robot.believed() == pytest.approx((off_m, 0.0, 0.0), abs=1e-6)
    assert robot.localisation.sigmas[0] == 0.5
    driven.drive(Twist(0.5), 1.5)
    error = math.dist(robot.believed()[:2], robot.physics.pose[:2])
    assert (error > 1.0) == (robot.localisation.sigmas[0] == 0.5) == is_lost
