"""Obstacles that have left do not hold the robot; obstacles still there do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.sensing.depth import Columns, columns_of, seen_through, top_m
from robots.bridge.gate.values import LaserScan
from robots.shared.geometry.planar import from_columns
from robots.shared.geometry.poses import Pose
from tests.gate.conftest import LASER, tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, VIEW, WALL, Looker, camera, picture

LASER_M = 0.09  # above the floor


def column(x, low, high, without=()):
    """A remembered column straight ahead, with points at all levels except `without`."""
    levels = [n for n in range(math.floor(low * 10.0), math.floor(high * 10.0) + 1) if n not in without]
    numbers = (np.array([value], dtype=np.float32) for value in (low, high))
    bits = np.array([sum(1 << n for n in levels)], dtype=np.uint16)
    return Columns(from_columns(np.array([x]), np.array([0.0])), *numbers, bits)


def gone(boxes, *what, **how):
    to_base = camera(LOOK_AHEAD)
    return bool(seen_through(picture(boxes, to_base, noise=0.0015), to_base, column(*what, **how))[0])


# --- one picture --------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [0.8, 1.0, 1.5])
def test_low_things_go_where_the_near_floor_is_seen(x):
    assert gone([FLOOR], x, 0.06, 0.09)
    there = ((x - 0.03, -0.1, 0.0), (x + 0.03, 0.1, 0.09))
    assert not gone([FLOOR, there], x, 0.06, 0.09)


@pytest.mark.parametrize("x", [0.5, 1.0, 2.0])
def test_a_person_is_gone_though_the_picture_ends_below_the_head(x):
    assert gone([FLOOR, WALL], x, 0.06, 1.29)
    for part in (0.5, 0.9, 1.29):
        rest = ((x - 0.02, -0.2, 0.0), (x + 0.1, 0.2, part))
        shown = picture([FLOOR, WALL, rest], camera(LOOK_AHEAD))
        if len(columns_of(shown, camera(LOOK_AHEAD), top_m(camera(), VIEW.height_m)).points):
            assert not gone([FLOOR, WALL, rest], x, 0.06, part)


def test_noise_above_a_box_out_of_view_does_not_free_it():
    """Only noise above the box is in view: if the noise is gone, the box may still be there."""
    assert not gone([FLOOR], 0.55, 0.06, 0.45)
    assert not gone([FLOOR], 0.55, 0.06, 0.50)


def test_a_cupboard_stays_when_the_box_below_it_goes():
    assert gone([FLOOR, WALL], 2.0, 0.06, 1.2)
    assert not gone([FLOOR, WALL], 2.0, 0.06, 1.2, without=range(4, 10))


# --- camera and laser together ---------------------------------------------------------------------------


REAR = "/scan_rear"


class Watcher(Looker):
    """A Looker whose laser sees the same boxes as its camera. An optional rear laser sees nothing."""

    def __init__(self, boxes, rear=False):
        poses = tiago_profile().scan_poses
        super().__init__(boxes, scan_poses={**poses, REAR: (-0.2, 0.0, math.pi)} if rear else poses)
        self.to_base = camera(LOOK_AHEAD)
        self.rear = rear

    def scan(self, **changes):
        x, y, _ = self.gate.profile.scan_poses[LASER]
        origin = np.array([self.pose.x + x, self.pose.y + y])
        angles = np.linspace(-math.radians(95), math.radians(95), 571)
        rays = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        self.ranges = np.full(571, math.inf)
        for low, high in self.boxes:
            if low[2] <= LASER_M < high[2]:
                with np.errstate(divide="ignore", invalid="ignore"):
                    ends = np.stack([(np.array(end[:2]) - origin) / rays for end in (low, high)])
                enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
                met = (enter <= leave) & (enter > 0.0)
                self.ranges[met] = np.minimum(self.ranges[met], enter[met])
        super().scan(**changes)
        if self.rear:
            half = math.radians(60)
            self.gate.observe_scan(
                LaserScan(
                    REAR,
                    self.stamp_s,
                    self.now_s,
                    np.full(121, math.inf),
                    angle_min=-half,
                    angle_increment=half / 60,
                    range_min_m=0.05,
                    range_max_m=25.0,
                )
            )

    def held(self):
        return self.decide(0.3).velocity.vx < 0.05

    def walk(self, ways):
        """A person appears at these places, one picture each."""
        around = self.boxes
        for x, y in ways:
            self.boxes = [*around, *person(x, y)]
            self.stand(0.2)
        self.boxes = around


def person(x, y):
    legs = [((x, y + side - 0.06, 0.0), (x + 0.12, y + side + 0.06, 0.8)) for side in (-0.1, 0.1)]
    return [*legs, ((x - 0.04, y - 0.2, 0.55), (x + 0.16, y + 0.2, 1.7))]


CROSSES = [(0.38, -1.4 + 0.2 * step) for step in range(15)]


def test_a_crossing_person_holds_the_robot_below_a_second():
    watcher = Watcher([FLOOR])
    watcher.stand(1.0)
    watcher.walk(CROSSES[:8])
    assert watcher.held()
    watcher.walk(CROSSES[8:])
    watcher.stand(0.8)
    assert not watcher.held()


def test_a_legless_desk_stays_after_a_person_passed():
    desk = ((0.35, -0.7, 0.70), (1.2, 0.7, 0.74))
    watcher = Watcher([FLOOR, desk])
    for x in np.arange(-1.0, 0.001, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    assert watcher.held()
    watcher.walk([(0.45, y) for _, y in CROSSES])
    watcher.stand(3.0)
    assert watcher.held()


def test_a_chair_pulled_away_is_gone_when_its_place_is_seen():
    chair = [((0.6, -0.2, 0.40), (1.0, 0.2, 0.45)), ((0.95, -0.2, 0.0), (1.0, 0.2, 0.95))]
    watcher = Watcher([FLOOR, *chair])
    for x in np.arange(-1.0, 0.251, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    assert watcher.held()
    watcher.boxes = [FLOOR]
    watcher.stand(0.5)
    watcher.pose = Pose(-0.2, 0.0, 0.0)
    watcher.stand(0.5)
    assert watcher.nearest_by("depth, remembered") == math.inf


def test_a_legless_desk_stays_after_a_person_stood_there():
    desk = ((0.35, -0.7, 0.70), (1.2, 0.7, 0.74))
    watcher = Watcher([FLOOR, desk, *person(0.45, 0.05)])
    for x in np.arange(-1.0, 0.001, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    assert watcher.held()
    watcher.boxes = [FLOOR, desk]
    watcher.walk([(0.45, 0.05 + 0.2 * step) for step in range(8)])
    watcher.stand(3.0)
    assert watcher.held()


@pytest.mark.parametrize("rear", [False, True])
def test_a_leaving_person_holds_the_robot_below_a_second(rear):
    watcher = Watcher([FLOOR, *person(0.45, 0.05)], rear)
    for x in np.arange(-1.0, 0.051, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    assert watcher.held()
    watcher.boxes = [FLOOR]
    watcher.walk([(0.45, 0.05 + 0.2 * step) for step in range(8)])
    watcher.stand(0.8)
    assert not watcher.held()


@pytest.mark.parametrize("rear", [False, True])
def test_posts_moved_by_slipping_wheels_are_gone(rear):
    """Wheel slip moves remembered points nearer than they are; the laser shows their true place."""
    posts = [((0.62, side * 0.35 - 0.1, 0.0), (0.74, side * 0.35 + 0.1, 2.0)) for side in (-1.3, 1.3)]
    watcher = Watcher([FLOOR, *posts], rear)
    for x in np.arange(-1.0, 0.301, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    watcher.boxes = [FLOOR, *(((x + 0.1, *low), (u + 0.1, *high)) for (x, *low), (u, *high) in posts)]
    watcher.stand(0.5, looks=False)
    assert not (remembered(watcher)[:, 0] < 0.35).any()  # 7 cm nearer than the present points


def test_a_counter_standing_back_stays_though_scans_see_below():
    counter = [((0.6, -0.5, 0.12), (1.2, 0.5, 0.9)), ((0.65, -0.5, 0.0), (1.2, 0.5, 0.12))]
    watcher = Watcher([FLOOR, *counter])
    for x in np.arange(-1.0, 0.201, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    watcher.stand(1.0, looks=False)
    assert watcher.nearest_by("depth, remembered") == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize(("seconds", "stays"), [(0.3, False), (1.0, True)])
def test_brief_visitors_fade_where_no_sensor_looks(seconds, stays):
    """Also at standstill: once a person's arm next to the laser held the robot for 5 s after the person had gone."""
    looker = Looker([FLOOR])
    looker.stand(1.0)
    looker.boxes = [FLOOR, ((1.0, -0.2, 0.8), (1.2, 0.2, 1.0))]
    looker.stand(seconds)
    looker.to_base = camera(pan=1.2)
    looker.stand(1.5)
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.0, abs=0.05)
    looker.stand(1.0)
    assert math.isfinite(looker.nearest_by("depth, remembered")) == stays


def test_a_body_leaning_over_its_feet_stays_in_memory():
    watcher = Watcher([FLOOR, *person(0.55, 0.05)])
    for x in np.arange(-1.0, 0.051, 0.05):
        watcher.pose = Pose(float(x), 0.0, 0.0)
        watcher.stand(0.2)
    watcher.stand(3.0, looks=False)
    assert watcher.nearest_by("depth, remembered") == pytest.approx(0.46, abs=0.02)  # the feet are at 0.50


def remembered(watcher):
    """Points remembered from the camera, base frame."""
    known = watcher.gate.obstacles(watcher.now_s)
    return known.points[known.source == known.names.index("depth, remembered")]
