"""Movers in ray-cast scans: walking people are seen with their velocity; a static world never moves."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np
import pytest

from robots.bridge.gate.movers.forecast import MOST_MPS, forecast
from robots.bridge.gate.movers.movers import Movers
from robots.bridge.gate.sensing.scan import Sweep
from robots.shared.geometry.planar import NO_POINTS, placed
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, tiago_profile
from tests.gate.world import ORIGIN, World, doorway, leg, wall

ROOM = [*wall(5, -4, 5, 4), *wall(-2, 4, 5, 4), *wall(-2, -4, 5, -4), *wall(-2, -4, -2, 4)]
FURNITURE = [
    *leg(2.0, 0.8),
    *leg(2.6, 0.8),
    *leg(2.0, 1.6, 0.03),
    *leg(3.0, -1.0, 0.4),
    *wall(1.0, -2.0, 4.5, -2.6),
    *doorway(4.0, 0.8, y=2.0)[:4],
]
SCAN_S = 0.1
HALF_VIEW = math.radians(95)
BEAMS = 572
INCREMENT = 2 * HALF_VIEW / (BEAMS - 1)
SENSOR = Pose(*tiago_profile().scan_poses[LASER])


def person(x, y, radius=0.15):
    """A person as an octagon."""
    turns = np.linspace(0.0, math.tau, 9)
    corners = [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]
    return [(*a, *b) for a, b in pairwise(corners)]


class Scene:
    """Feeds one `Movers` with scans of a room at 10 Hz, from a robot that may drive."""

    def __init__(self, seed=0, furniture=(), noise_m=0.01, drop_out=0.01, yaw_drift=0.0, way_drift=0.0):
        self.world = World(tiago_profile(), ROOM, seed)
        self.furniture = [*ROOM, *furniture]
        self.movers = Movers()
        self.now_s = 1000.0
        self.noise_m, self.drop_out = noise_m, drop_out
        self.yaw_drift, self.way_drift = yaw_drift, way_drift
        self.measured = ORIGIN  # pose by odometry
        self.points = NO_POINTS

    def scan(self, somebody=(), frame=0):
        world, random = self.world, self.world.random
        world.ends = np.array([*self.furniture, *somebody], dtype=float).reshape(-1, 2, 2)
        ranges = world.rays(SENSOR, -HALF_VIEW + INCREMENT * np.arange(BEAMS))
        ranges += random.normal(0.0, self.noise_m, BEAMS)
        ranges[random.random(BEAMS) < self.drop_out] = math.nan
        sweep = Sweep(ranges, -HALF_VIEW, INCREMENT, 0.05, 25.0)
        sensor = Pose(*placed(np.array([SENSOR[:2]]), self.measured)[0].tolist(), self.measured.yaw)
        self.points = placed(sweep.points(), sensor)
        points = self.points
        self.movers.observe(lambda: points, sweep, sensor, self.now_s, frame)

    def drive(self, velocity):
        """Drive for 0.1 s. The odometry's error grows with time and way."""
        self.now_s += SCAN_S
        self.world.pose = self._on(self.world.pose, velocity.vx, velocity.w)
        self.measured = self._on(
            self.measured, velocity.vx * (1 + self.way_drift), velocity.w + self.yaw_drift
        )

    @staticmethod
    def _on(pose, vx, w):
        heading = pose.yaw + w * SCAN_S / 2
        return Pose(
            pose.x + SCAN_S * vx * math.cos(heading),
            pose.y + SCAN_S * vx * math.sin(heading),
            pose.yaw + w * SCAN_S,
        )

    def moving(self):
        """Places and velocities of what moves."""
        tracks = [track for track in self.movers.tracks if track.mps > 0.2]
        return np.array([(one.x, one.y, one.vx, one.vy) for one in tracks]).reshape(-1, 4)


def walked(scene, start, velocity, seconds, robot=STILL, radius=0.15):
    """Results of `Movers` at each scan from 0.9 s on: (place of the person, what moves)."""
    seen = []
    for step in range(round(seconds / SCAN_S)):
        x, y = (start[axis] + velocity[axis] * step * SCAN_S for axis in (0, 1))
        scene.scan(person(x, y, radius))
        if step >= 9:
            seen.append(((x, y), scene.moving()))
        scene.drive(robot)
    return seen


@pytest.mark.parametrize(
    ("start", "velocity", "seed"),
    [
        ((2.0, -1.5), (0.0, 1.0), 1),  # crossing
        ((1.5, 1.2), (0.0, -0.6), 2),
        ((3.5, 0.2), (-1.0, 0.0), 3),  # straight at the robot
        ((3.0, -1.5), (-0.8, 0.8), 1),
        ((2.5, 1.5), (-0.4, -1.2), 2),
    ],
)
def test_a_walker_is_seen_with_about_the_right_velocity(start, velocity, seed):
    seen = walked(Scene(seed), start, velocity, 2.0)
    moving = [found for _, found in seen if len(found)]
    assert len(moving) >= 0.8 * len(seen), "at nearly each scan"
    errors = [np.hypot(*(found[:, 2:] - velocity).T).mean() for found in moving]
    assert np.median(errors) < 0.25


def test_only_the_person_moves():
    seen = walked(Scene(1, FURNITURE), (2.5, -0.7), (0.0, 0.9), 1.5)
    assert any(len(found) for _, found in seen)
    for (x, y), found in seen:
        assert np.hypot(found[:, 0] - x, found[:, 1] - y).max(initial=0.0) < 0.35


@pytest.mark.parametrize(
    "robot", [Velocity(0.5, 0.0, 0.0), Velocity(0.3, 0.0, 0.8), Velocity(0.0, 0.0, -1.2)]
)
def test_a_walker_is_seen_from_a_driving_robot(robot):
    seen = walked(Scene(4), (3.0, -0.8), (-0.2, 0.8), 1.5, robot)
    assert sum(len(found) > 0 for _, found in seen) >= 0.5 * len(seen)


@pytest.mark.parametrize(
    ("start", "y"), [((1.8, -0.75), -1.0), ((3.2, -0.84), -1.0)], ids=["along it", "touching it"]
)
def test_a_wall_does_not_move_with_a_person_along_it(start, y):
    seen = walked(Scene(3, wall(-1.0, y, 4.9, y)), start, (-0.9, 0.0), 1.5)
    assert any(len(found) for _, found in seen)
    for (x, y), found in seen:
        assert np.hypot(found[:, 0] - x, found[:, 1] - y).max(initial=0.0) < 0.5


STANDING = {
    "at rest": STILL,
    "forward": Velocity(1.0, 0.0, 0.0),
    "on an arc": Velocity(0.5, 0.0, 0.8),
    "turning": Velocity(0.0, 0.0, 2.0),
    "in reverse": Velocity(-0.2, 0.0, -0.5),
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("robot", STANDING.values(), ids=STANDING)
def test_in_a_standing_world_nothing_moves(robot, seed):
    """Noise 1 cm, 2% drop-outs; odometry wrong by 5% of the way and 1.2 deg/s."""
    sign = 1 if seed % 2 else -1
    scene = Scene(seed, FURNITURE, drop_out=0.02, yaw_drift=sign * 0.02, way_drift=-sign * 0.05)
    for _ in range(25):
        scene.scan()
        assert not scene.movers.tracks
        scene.drive(robot)


def test_somebody_in_a_place_that_one_scan_saw_free_moves_at_once():
    """A desk hides the place, is taken away, and the next scan but one has somebody there."""
    scene = Scene(13, drop_out=0.0)
    desk = wall(1.2, -0.6, 1.2, 0.6)
    for hidden in (desk, desk, desk, desk, []):
        scene.scan(hidden)
        scene.drive(STILL)
    assert not scene.movers.tracks
    scene.scan(person(2.0, 0.0))
    assert len(scene.movers.tracks) == 1


def test_a_leg_that_some_scans_miss_does_not_move():
    scene = Scene(14, drop_out=0.0)
    post = leg(2.0, 0.0, 0.06)
    for number in range(21):  # the last scan is compared with the 9th and 12th first
        scene.scan([] if number in (9, 12, 17) else post)
        scene.drive(STILL)
        assert not scene.movers.tracks


def test_a_person_who_stops_no_longer_moves():
    scene = Scene(5)
    walked(scene, (2.0, -1.0), (0.0, 1.0), 1.0)
    last = walked(scene, (2.0, 0.0), (0.0, 0.0), 2.5)
    assert not any(len(found) for _, found in last[8:])


def test_nobody_is_forecast_faster_than_people_walk():
    scene = Scene(6)
    walked(scene, (3.0, -2.4), (0.0, 2.3), 2.0)
    speeds = np.hypot(*forecast(scene.movers.tracks, scene.now_s).drift.velocity.T)
    assert speeds.max() <= MOST_MPS + 1e-9


def test_one_scan_or_a_pause_shows_no_motion():
    scene = Scene(8)
    scene.scan(person(2.0, 0.0))
    assert not scene.movers.tracks
    scene.now_s += 3.0
    scene.scan(person(2.0, 0.6))
    assert not scene.movers.tracks


def test_another_odometry_frame_makes_nothing_move():
    scene = Scene(9)
    walked(scene, (2.0, -1.0), (0.0, 1.0), 1.0)
    assert scene.movers.tracks
    scene.scan(person(2.0, 0.0), frame=1)
    assert not scene.movers.tracks


def test_stamps_that_go_back_start_again():
    scene = Scene(10)
    walked(scene, (2.0, -1.0), (0.0, 1.0), 1.0)
    scene.now_s -= 100.0
    scene.scan(person(2.0, 0.5))
    assert not scene.movers.tracks


def test_an_empty_scan_is_fine():
    scene = Scene(11)
    scene.furniture = [(90.0, 0.0, 91.0, 0.0)]
    for _ in range(8):
        scene.scan()
        scene.drive(STILL)
    assert not scene.movers.tracks


def hidden_behind(x, y, width):
    """A desk between the laser and a place 2 m ahead."""
    return wall(x, y - width / 2, x, y + width / 2)


def test_a_person_behind_a_desk_is_followed_for_a_second():
    scene = Scene(12, hidden_behind(1.2, 0.35, 0.5))  # hides about y = 0.1 to 1.2 at x = 2
    seen = walked(scene, (2.0, -1.4), (0.0, 1.0), 2.2)
    (x, y), found = seen[-1]
    assert y > 0.5
    assert len(found)
    assert np.hypot(found[0, 0] - x, found[0, 1] - y) < 0.35


# --- in the gate ----------------------------------------------------------------------------------


class Crossing(World):
    """A person walks straight across or towards the robot and does not stop."""

    def __init__(self, seed, start, velocity):
        super().__init__(tiago_profile(), ROOM, seed)
        self.start, self.walk = start, velocity
        self.touched_at_mps = None

    def sense(self):
        x, y = (self.start[axis] + self.walk[axis] * (self.now_s - 50.0) for axis in (0, 1))
        self.ends = np.array([*ROOM, *person(x, y)], dtype=float).reshape(-1, 2, 2)
        super().sense()
        near = math.hypot(x - self.pose.x, y - self.pose.y) < 0.15 + self.profile.radius_m
        if near and self.touched_at_mps is None:
            self.touched_at_mps = abs(self.velocity.vx)


@pytest.mark.parametrize(("early_s", "seed"), [(0.0, 1), (0.6, 2)])
def test_the_robot_stands_when_a_person_walks_into_its_way(early_s, seed):
    """At 0.6 m/s, the robot would hit the person 2 m ahead, with its front or its side."""
    world = Crossing(seed, (2.0, -3.3 + 0.8 * early_s), (0.0, 0.8))
    codes = set()
    for _ in range(120):
        verdict = world.drive(Velocity(0.6, 0.0, 0.0), 0.05)
        codes.add(verdict.code)
        if verdict.code == "mover":
            assert re.search(r"moving( at \d\.\d m/s)?, laser, ", verdict.text)
    assert world.touched_at_mps is None or world.touched_at_mps < 0.02
    assert "mover" in codes


def test_a_robot_may_turn_away_from_an_approaching_person():
    world = Crossing(1, (2.0, 0.0), (-0.8, 0.0))
    world.drive(STILL, 1.6)
    world.start, world.walk = (0.72, 0.0), (0.0, 0.0)
    assert world.drive(Velocity(0.0, 0.0, 1.0), 0.5).velocity.w == pytest.approx(1.0)


def test_points_are_computed_only_for_a_query_of_movers():
    scene, asked = Scene(), []
    observe = scene.movers.observe

    def counting(points, *more):
        observe(lambda: asked.append(1) or points(), *more)

    scene.movers.observe = counting
    for _ in range(40):
        scene.scan()
        scene.drive(STILL)
    assert not asked
    assert not scene.movers.tracks
    assert len(asked) <= 15  # those of the last 1.4 s
