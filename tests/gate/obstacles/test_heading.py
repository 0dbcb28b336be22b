"""When wheels slip in a turn, the laser measures the true turn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.shared.geometry.planar import placed, relative_to
from robots.shared.geometry.poses import Pose, Velocity
from tests.gate.conftest import tiago_profile
from tests.gate.world import World, leg, wall

TURN = Velocity(0.0, 0.0, 1.5)
LEG = (0.75, 0.0)
ROOM = wall(-3, -2, 4, -2) + wall(4, -2, 4, 2.5) + wall(4, 2.5, -3, 2.5) + wall(-3, 2.5, -3, -2)
HALL = [
    (*(6 * np.array([math.cos(a), math.sin(a)])), *(6 * np.array([math.cos(b), math.sin(b)])))
    for a, b in ((math.radians(d), math.radians(d + 1)) for d in range(360))
]


def slipping(segments, slip=0.28, **changes) -> World:
    """A TIAGo in front of a leg, without sonars: it detects nothing behind it, and has only its memory."""
    profile = tiago_profile(sonar_poses={}, sonar_fov={})
    return World(profile, segments + leg(*LEG, 0.06), slip=slip, **changes)


def turned(world: World, yaw: float, asked=TURN) -> World:
    """Turn the robot to `yaw`, then stop it."""
    while world.pose.yaw < yaw:
        world.drive(asked, 0.05)
    world.drive(Velocity(0.0, 0.0, 0.0), 1.5)
    return world


def believed(world: World) -> Pose:
    """The pose that the gate believes: its odometry, with turns as the laser measured them."""
    return world.gate._trail.newest


def off_rad(world: World) -> float:
    """Error (rad) of the gate's heading."""
    return math.remainder(believed(world).yaw - world.pose.yaw, math.tau)


@pytest.mark.parametrize("seed", range(3))
def test_it_does_not_back_into_obstacles_seen_before_its_turn(seed):
    world = turned(slipping(ROOM, seed=seed), math.radians(170))
    world.drive(Velocity(-0.2, 0.0, 0.0), 6.0)
    assert world.least_gap_m > 0.0


@pytest.mark.parametrize("noise_m", [0.01, 0.03])
@pytest.mark.parametrize("half_view", [90.0, 135.0])
@pytest.mark.parametrize("beams", [181, 1081])
def test_remembered_points_stay_in_place_during_a_slip(noise_m, half_view, beams):
    world = slipping(ROOM, noise_m=noise_m, half_view=math.radians(half_view), beams=beams)
    turned(world, math.radians(175))
    assert abs(off_rad(world)) < math.radians(8)
    obstacles = world.gate.obstacles(world.now_s)
    there = placed(np.array([LEG]), relative_to(Pose(0.0, 0.0, 0.0), world.pose))
    assert np.hypot(*(obstacles.points - there).T).min() < 0.12


def test_the_share_holds_on_where_nothing_is_in_view_any_more():
    table = [segment for x in (0.8, 1.5) for y in (-0.7, 0.7) for segment in leg(x, y, 0.06)]
    world = turned(slipping(table), math.radians(175))
    assert abs(off_rad(world)) < math.radians(12)


def test_one_thing_alone_proves_no_turn():
    world = turned(slipping([]), math.radians(100))
    assert believed(world) == world.odometry


@pytest.mark.parametrize("slip", [-0.04, 0.0, 0.04])
def test_ordinary_drift_changes_nothing(slip):
    world = turned(slipping(ROOM, slip=slip), math.radians(175))
    assert believed(world) == world.odometry


def test_a_person_walking_along_changes_nothing():
    world = slipping(ROOM, slip=0.0)

    def walked(world: World) -> Velocity:
        """A person walks around the robot as it turns: compared with this person, the robot hardly turns."""
        yaw = 0.9 * world.pose.yaw + 0.3
        world.put(ROOM + leg(*LEG, 0.06) + leg(0.8 * math.cos(yaw), 0.8 * math.sin(yaw), 0.4))
        return TURN

    turned(world, math.radians(175), walked)
    assert believed(world) == world.odometry


def test_a_round_hall_gives_no_evidence_and_changes_nothing():
    world = slipping(HALL, slip=0.28)
    world.put(HALL)
    turned(world, math.radians(175))
    assert believed(world) == world.odometry


def test_a_laser_repeating_one_scan_does_not_stop_the_turn():
    world = slipping(ROOM, slip=0.0)
    seen = world.rays(world.profile.scan_poses["/scan_raw"], np.linspace(-1.65, 1.65, 572))
    world.rays = lambda mount, angles: seen.copy()
    turned(world, math.radians(175))
    assert believed(world) == world.odometry


def test_a_drive_continues_from_a_corrected_turn():
    world = turned(slipping(ROOM, noise_m=0.003), math.radians(60))
    world.slip = 0.0
    before, begun = believed(world), world.pose
    world.drive(Velocity(0.5, 0.0, 0.0), 1.5)
    after = relative_to(believed(world), before)
    truly = relative_to(world.pose, begun)
    assert truly.x > 0.2
    assert (after.x, after.y) == pytest.approx((truly.x, truly.y), abs=0.01)
