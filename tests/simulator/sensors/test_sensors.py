"""Sensor data agrees with the true world."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.simulator.joints.frames import camera_pose
from robots.simulator.joints.joint_table import HOME
from robots.simulator.physics.mujoco_world import Pose, WorldReader
from robots.simulator.sensors.depth import FOCAL_PX, HEIGHT, WIDTH, DepthCamera, as_millimetres
from robots.simulator.worlds import Box, Table, World
from tests.simulator.conftest import room

LASER_X = 0.202


def to_wall(origin_x: float, origin_y: float, angle: float) -> float:
    """Distance from a point in the empty room to its walls, by geometry."""
    cos, sin = math.cos(angle), math.sin(angle)
    ways = []
    if abs(cos) > 1e-9:
        ways.append((math.copysign(2.0, cos) - origin_x) / cos)
    if abs(sin) > 1e-9:
        ways.append((math.copysign(2.0, sin) - origin_y) / sin)
    return min(ways)


@pytest.mark.parametrize("pose", [Pose(0.0, 0.0, 0.0), Pose(0.5, -0.7, 2.0)])
def test_a_scan_is_the_rooms_outline_with_a_centimetre_of_noise(robot_in, pose):
    robot = robot_in(room(), pose).robot
    x = pose.x + LASER_X * math.cos(pose.yaw)
    y = pose.y + LASER_X * math.sin(pose.yaw)
    expected = np.array([to_wall(x, y, pose.yaw + angle) for angle in robot.laser.angles])
    errors = np.concatenate([robot.laser.scan(robot.physics) - expected for _ in range(20)])
    errors = errors[np.isfinite(errors)]
    assert abs(errors.mean()) < 0.001
    assert 0.009 < errors.std() < 0.011


def test_some_rays_drop_out(robot_in):
    robot = robot_in(room()).robot
    scans = np.stack([robot.laser.scan(robot.physics) for _ in range(20)])
    assert 0.001 < np.isnan(scans).mean() < 0.02


def test_too_near_is_minus_infinity_and_nothing_is_plus_infinity(robot_in):
    near = Box(name="near", at=(LASER_X + 0.13, 0.0), size=(0.2, 0.02, 0.5))
    robot = robot_in(room(boxes=[near])).robot
    middle = len(robot.laser.angles) // 2
    scans = np.stack([robot.laser.scan(robot.physics) for _ in range(20)])
    assert np.isneginf(scans[:, middle]).any()

    open_world = room()
    open_world.walls.clear()
    robot = robot_in(open_world).robot
    scan = robot.laser.scan(robot.physics)
    assert np.isposinf(scan[~np.isnan(scan)]).all()


def test_the_laser_sees_table_legs_but_no_top(robot_in):
    with_legs = room(tables=[Table(name="table", at=(1.2, 0.0), size=(0.8, 0.8))])
    without = room(tables=[Table(name="desk", at=(1.2, 0.0), size=(0.8, 0.8), legs=False)])
    legs = robot_in(with_legs).robot
    assert np.nanmin(legs.laser.scan(legs.physics)) < 0.75
    hidden = robot_in(without).robot
    assert np.nanmin(hidden.laser.scan(hidden.physics)) > 1.7


def test_pals_filter_blanks_a_square_about_the_base(robot_in):
    # Both boxes are within 30 cm of the laser; only the left box is in the square of +-30 cm about the base.
    things = [
        Box(name="left", at=(LASER_X, 0.26), size=(0.05, 0.05, 0.5)),
        Box(name="ahead", at=(0.45, 0.0), size=(0.05, 0.3, 0.5)),
    ]
    robot = robot_in(room(boxes=things)).robot
    raw = robot.laser.scan(robot.physics)
    blanked = robot.laser.blanked(raw)
    left = np.abs(robot.laser.angles - math.pi / 2) < 0.05
    ahead = np.abs(robot.laser.angles) < 0.05
    assert np.nanmin(raw[left]) < 0.27
    assert np.isnan(blanked[left]).all()
    assert np.nanmin(raw[ahead]) < 0.25
    np.testing.assert_array_equal(raw[ahead], blanked[ahead])


def test_sonars_report_obstacles_behind(robot_in):
    behind = Box(name="behind", at=(-0.259 - 0.5 - 0.1, 0.0), size=(0.2, 0.2, 0.6))
    robot = robot_in(room(boxes=[behind])).robot
    right, back, left = robot.sonars
    assert back.range_m(robot.physics) == pytest.approx(0.5, abs=0.03)
    assert right.range_m(robot.physics) == right.mount.longest_m
    assert left.range_m(robot.physics) == left.mount.longest_m


def test_a_depth_picture_is_the_wall_ahead(robot_in):
    robot = robot_in(room()).robot
    reader = WorldReader(robot.physics)
    reader.follow(robot.physics.snapshot())
    pose = camera_pose(HOME)
    depth = DepthCamera(np.random.default_rng(1)).image(reader, pose)
    assert depth.shape == (HEIGHT, WIDTH)
    wall = 2.0 - pose.origin[0]
    assert np.nanmedian(depth[200:280]) == pytest.approx(wall, abs=0.02), "along the optical axis: flat"
    assert 0.005 < np.isnan(depth).mean() < 0.05
    floor = pose.origin[2] / ((HEIGHT - 4 - HEIGHT / 2) / FOCAL_PX)
    assert np.nanmedian(depth[-4:]) == pytest.approx(min(floor, wall), abs=0.05)


def test_the_floor_is_seen_in_a_world_where_little_else_stands(robot_in):
    leg = Box(name="leg", at=(2.0, 0.0), size=(0.04, 0.04, 0.7))
    bare = World(name="bare", size=(-8.0, -8.0, 8.0, 8.0), boxes=[leg])
    robot = robot_in(bare, Pose(0.0, 0.0, 0.0)).robot
    reader = WorldReader(robot.physics)
    reader.follow(robot.physics.snapshot())
    pose = camera_pose(HOME | {"head_2_joint": -0.68})
    depth = DepthCamera(np.random.default_rng(1)).image(reader, pose)
    assert np.isnan(depth).mean() < 0.05
    assert np.nanmedian(depth[238:242]) == pytest.approx(pose.origin[2] / math.sin(0.68), abs=0.05)
    assert robot.physics.contacts() == [], "the base stands in the floor and touches nothing"


def test_a_point_cloud_is_the_depth_picture_in_space(robot_in):
    robot = robot_in(room()).robot
    reader = WorldReader(robot.physics)
    reader.follow(robot.physics.snapshot())
    pose = camera_pose(HOME | {"head_1_joint": 0.4, "head_2_joint": -0.6})
    camera = DepthCamera(np.random.default_rng(1))
    points = camera.points(camera.image(reader, pose)).reshape(-1, 3)
    right, down, ahead = points[~np.isnan(points[:, 2])].T
    x, y, z = pose.origin[:, None] + pose.axes @ np.stack((ahead, -right, -down))
    # The camera sees the wall ahead, the left wall and the floor: every point lies on one of them.
    apart = np.abs([x - 2.0, y - 2.0, z])
    assert np.quantile(apart.min(axis=0), 0.99) < 0.03
    assert (apart.min(axis=1) < 0.01).all()


def test_the_depth_camera_sees_a_table_top_that_the_laser_misses(robot_in):
    world = room(tables=[Table(name="desk", at=(1.2, 0.0), size=(0.8, 1.6), legs=False)])
    robot = robot_in(world).robot
    reader = WorldReader(robot.physics)
    reader.follow(robot.physics.snapshot())
    depth = DepthCamera(np.random.default_rng(1)).image(reader, camera_pose(HOME | {"head_2_joint": -0.6}))
    assert np.nanmin(depth) < 1.0


def test_sixteen_bits_hold_millimetres_and_zero_for_nothing():
    assert as_millimetres(np.array([1.5, np.nan], dtype=np.float32)).tolist() == [1500, 0]
