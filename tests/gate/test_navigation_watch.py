"""The watch over a robot that drives itself judges obstacles where they were seen or heard."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate import navigation_watch
from robots.bridge.gate.values import Pose, Velocity
from tests.gate.conftest import LASER, Feeder, tiago_profile
from tests.gate.test_depth import FLOOR, LOOK_AHEAD, TABLE, Looker, camera
from tests.gate.test_near_side import RADIUS_M, NearSighted

AWAY = [0.15 * step for step in (*range(21), *range(20, 12, -1), *range(12, 21))]  # to and fro, rad
DEPTH, REMEMBERED = "depth", "depth, remembered"


def watched(feeder, vx, w=0.0):
    """Return the watch's verdict on a robot that moves so, as navigation asks."""
    feeder.velocity = Velocity(vx, 0.0, w)
    feeder.now_s += 0.02
    feeder.odometry()
    return navigation_watch.judge(feeder.gate, feeder.velocity, feeder.now_s)


def nearest_m(obstacles, name):
    """Return the distance of the source's nearest point from the base's middle."""
    mine = obstacles.points[obstacles.source == obstacles.names.index(name)]
    return float(np.hypot(*mine.T).min(initial=math.inf))


def test_it_brakes_for_what_the_laser_sees():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.4)
    feeder.all()
    verdict = watched(feeder, 0.5)
    assert (verdict.code, verdict.sensor, verdict.velocity.vx) == ("obstacle", LASER, 0.0)
    assert watched(feeder, 0.1).code == "free"


@pytest.mark.parametrize("pictures_end", [False, True])
def test_an_unseen_near_side_holds_the_stick_only(pictures_end):
    looker = NearSighted(0.15, 1.217)  # a table whose near edge the camera cannot measure
    looker.stand(0.5)
    looker.turn(math.pi / 2.0)
    if pictures_end:
        looker.stand(0.6, looks=False)
    assert looker.decide(0.2).velocity.vx == 0.0
    assert watched(looker, 0.2).code == "free"
    verdict = watched(looker, 0.8)  # it could not stop at what was seen either
    assert verdict.code == "obstacle"
    assert verdict.sensor in ((REMEMBERED,) if pictures_end else (DEPTH, REMEMBERED))


def test_a_table_top_that_no_picture_shows_any_more_is_braked_for():
    looker = Looker([FLOOR, TABLE])
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.5)
    for step in range(11):
        looker.pose = Pose(0.1 * step, 0.0, 0.0)
        looker.stand(0.1)
    looker.stand(0.6, looks=False)
    assert watched(looker, 0.1).code == "free"
    verdict = watched(looker, 0.5)
    assert (verdict.code, verdict.sensor) == ("obstacle", REMEMBERED)


def test_the_odometrys_doubt_brings_nothing_nearer():
    looker = Looker([FLOOR, TABLE])
    looker.pose = Pose(0.9, 0.0, 0.0)
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.5)
    edge_m = nearest_m(looker.gate.obstacles(looker.now_s), DEPTH)
    for yaw in AWAY:
        looker.pose = looker.pose._replace(yaw=yaw)
        looker.stand(0.1)
    known, seen = looker.gate.obstacles(looker.now_s), looker.gate.obstacles_as_seen(looker.now_s)
    assert nearest_m(known, REMEMBERED) < edge_m - 0.05
    assert nearest_m(seen, REMEMBERED) == pytest.approx(edge_m, abs=0.02)


def test_the_lasers_memory_counts_where_it_saw():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.4)
    for _ in range(20):
        feeder.now_s += 0.1
        feeder.all()
    wall_m = nearest_m(feeder.gate.obstacles(feeder.now_s), LASER)
    feeder.ranges = np.where(np.arange(571) < 280, math.nan, 2.0)
    for yaw in AWAY:
        feeder.pose = feeder.pose._replace(yaw=yaw)
        feeder.now_s += 0.1
        feeder.all()
    name = f"{LASER}, remembered"
    known, seen = feeder.gate.obstacles(feeder.now_s), feeder.gate.obstacles_as_seen(feeder.now_s)
    assert RADIUS_M < nearest_m(known, name) < wall_m - 0.02
    assert nearest_m(seen, name) == pytest.approx(wall_m, abs=0.02)
    assert len(seen.points) == len(seen.source)


def test_no_place_inside_the_hull_counts():
    looker = Looker([FLOOR, TABLE])
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.5)
    for step in range(21):
        looker.pose = Pose(0.08 * step, 0.0, 0.0)
        looker.stand(0.1, looks=False)
    looker.odometry()
    nearest = nearest_m(looker.gate.obstacles_as_seen(looker.now_s), REMEMBERED)
    assert RADIUS_M - 0.03 <= nearest < RADIUS_M + 0.05
