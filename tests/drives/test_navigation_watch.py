"""The watch over a robot that drives itself judges obstacles at their measured places."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate import navigation_watch
from robots.bridge.navigation.navigation_goals import LEAST_SPARE_M
from robots.shared.configuration.gate_profile import Parameters
from robots.shared.geometry.poses import Pose, Velocity
from tests.drives.test_near_side import RADIUS_M, NearSighted
from tests.gate.conftest import LASER, Feeder, tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, TABLE, Looker, camera

AWAY = [0.15 * step for step in (*range(21), *range(20, 12, -1), *range(12, 21))]  # back and forth, rad
BOX = ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25))
DEPTH, REMEMBERED = "depth", "depth, remembered"


def watched(feeder, vx, w=0.0):
    """Return the watch's verdict on a robot that moves like this and has this command of navigation."""
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
    assert watched(looker, 0.8).code == "obstacle"  # too fast to stop before the measured part of the table


def test_it_brakes_for_what_the_picture_shows():
    looker = Looker([FLOOR, TABLE])
    looker.pose = Pose(0.9, 0.0, 0.0)
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.5)
    verdict = watched(looker, 0.6)
    assert (verdict.code, verdict.sensor) == ("obstacle", DEPTH)


def test_it_brakes_for_an_echo_behind_and_not_for_an_old_one_ahead():
    feeder = Feeder(tiago_profile(has_depth=True))  # with it, the laser alone clears no echo
    feeder.odometry()
    feeder.scan()
    behind = "base_sonar_02_link"
    feeder.gate.observe_range(behind, feeder.stamp_s, feeder.now_s, 0.15, 1.0)
    verdict = watched(feeder, -0.4)
    assert (verdict.code, verdict.sensor) == ("obstacle", behind)
    assert watched(feeder, 0.4).code == "free"
    for step in range(1, 22):  # then the echo's place is ahead, and the laser sees nothing there
        feeder.pose = Pose(0.0, 0.0, math.pi * step / 21)
        feeder.now_s += 0.1
        feeder.odometry()
        feeder.scan()
    feeder.sonars()  # no echo in their present directions
    known = feeder.gate.obstacles_as_seen(feeder.now_s)
    assert known.points[known.source == known.names.index(navigation_watch.ECHOES), 0].max() > 0.3
    assert watched(feeder, 0.4).code == "free"
    assert feeder.decide(0.4).velocity.vx < 0.4  # but the gate limits a person's stick


def test_what_navigation_is_about_to_do_counts():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.12)
    feeder.all()
    assert watched(feeder, 0.0).code == "free"
    ahead, back = Velocity(0.5, 0.0, 0.0), Velocity(-0.2, 0.0, 0.0)
    assert navigation_watch.judge(feeder.gate, ahead, feeder.now_s).code == "obstacle"
    assert navigation_watch.judge(feeder.gate, back, feeder.now_s).code == "free"


def test_a_thin_thing_at_the_edge_of_the_way_is_braked_for_in_time():
    """The gate adds possible drift: it moves the place nearer, where a box could no longer avoid the thing.

    The watch must still use the place as the camera measured it.
    """
    thing = ((1.6, 0.22, 0.66), (1.64, 0.27, 0.74))
    looker = Looker([FLOOR, thing], radius_m=None, outline=BOX)
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.6)
    looker.to_base = camera(pan=1.2)
    for yaw in (*AWAY, *AWAY[::-1]):
        looker.pose = looker.pose._replace(yaw=yaw)
        looker.stand(0.1)
    while watched(looker, 0.4).code == "free":
        assert looker.pose.x < 1.6 - BOX[0][0] - 0.1, "the thing is 0.1 m ahead of the box"
        looker.pose = looker.pose._replace(x=looker.pose.x + 0.008, yaw=0.0)
        looker.all()


@pytest.mark.parametrize("edge_m", [0.035 + 0.02 * step for step in range(7)])
def test_a_goal_is_refused_where_an_unseen_near_side_may_begin(edge_m):
    looker = NearSighted(edge_m, 1.067)
    looker.stand(0.5)
    looker.turn(math.pi / 2.0)
    assert len(looker.gate.unseen_near_sides())
    assert navigation_watch.spare_m(looker.gate, looker.now_s) < LEAST_SPARE_M


def test_the_odometrys_doubt_refuses_no_goal():
    looker = Looker([FLOOR, TABLE])
    looker.pose = Pose(0.85, 0.0, 0.0)
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(0.5)
    for yaw in AWAY:
        looker.pose = looker.pose._replace(yaw=yaw)
        looker.stand(0.1)
        assert navigation_watch.spare_m(looker.gate, looker.now_s) > LEAST_SPARE_M + 0.01


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


def test_no_place_inside_the_hull_that_the_laser_remembers_counts():
    feeder = Feeder(tiago_profile())
    feeder.ahead_at(0.4)
    for _ in range(20):
        feeder.now_s += 0.1
        feeder.all()
    wall_m = nearest_m(feeder.gate.obstacles(feeder.now_s), LASER)
    feeder.ranges = np.where(np.abs(np.arange(571) - 285) < 100, math.nan, 2.0)  # no data from ahead
    name = f"{LASER}, remembered"
    found = {}
    for x in (0.1, 0.2, 0.3, 0.4, 0.5):
        feeder.pose = Pose(x, 0.0, 0.0)
        feeder.now_s += 0.1
        feeder.all()
        found[x] = nearest_m(feeder.gate.obstacles_as_seen(feeder.now_s), name)
    assert found[0.3] == pytest.approx(wall_m - 0.3, abs=0.02)
    assert found[0.5] > RADIUS_M


class Watched:
    """A robot that drives itself, with the watch. Its depth camera turns with its head."""

    def __init__(self, vx):
        self.looker = Looker([FLOOR])
        self.looker.to_base = camera(LOOK_AHEAD)
        self.looker.stand(0.5)
        self.watch, self.codes, self.vx = navigation_watch.Watch(), [], vx

    def drive(self, seconds, pan, looks=True):
        """Drive on; return for how long the watch allowed it (s)."""
        self.looker.to_base = camera(LOOK_AHEAD, pan=pan)
        for step in range(round(seconds / 0.1)):
            self.looker.velocity = Velocity(self.vx, 0.0, 0.0)
            self.looker.pose = self.looker.pose._replace(x=self.looker.pose.x + 0.1 * self.vx)
            self.looker.stand(0.1, looks=looks)
            self.verdict = self.watch.judge(self.looker.gate, self.looker.velocity, self.looker.now_s)
            if self.verdict.code != "free":
                return 0.1 * step
        return seconds


def test_a_head_that_looks_away_for_long_ends_a_fast_drive():
    watched = Watched(0.5)
    assert watched.drive(1.0, 0.0) == 1.0
    assert watched.drive(4.0, 1.2) == pytest.approx(navigation_watch.UNSEEN_S, abs=0.3)
    assert watched.verdict.code == "head_away" and watched.verdict.velocity.vx == 0.0
    assert watched.verdict.text == (
        "stopped: the robot drove 0.5 m/s forward, but the depth camera looks away from the way ahead"
    )


def test_a_glance_aside_and_a_slow_drive_go_on():
    watched = Watched(0.5)
    for pan in (1.2, 0.0, -1.2, 0.0):
        assert watched.drive(1.5, pan) == 1.5
    slow = Watched(0.3)
    assert slow.drive(4.0, 1.2) == 4.0
    slow.vx = 0.5  # slow driving does not count as a look at the way
    assert slow.drive(1.0, 1.2) == 0.0


def test_backing_up_fast_where_only_sonars_look_ends_a_drive():
    feeder = Feeder(tiago_profile(parameters=Parameters()))

    def backs(vx, seconds):
        watch = navigation_watch.Watch()
        for step in range(round(seconds / 0.1)):
            feeder.now_s += 0.1
            feeder.velocity = Velocity(vx, 0.0, 0.0)
            feeder.all()
            verdict = watch.judge(feeder.gate, feeder.velocity, feeder.now_s)
            if verdict.code != "free":
                return 0.1 * step, verdict
        return seconds, verdict

    assert backs(-0.12, 5.0)[0] == 5.0
    assert backs(-0.2, 0.4)[0] == 0.4
    backed_s, verdict = backs(-0.2, 5.0)
    assert backed_s == pytest.approx(navigation_watch.BLIND_S, abs=0.15)
    assert (verdict.code, verdict.way) == ("blind_direction", "reverse")
