"""A depth camera that is blind near by: an obstacle that enters its blind range may reach the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.geometry.poses import Pose, Velocity
from tests.gate.conftest import tiago_profile
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, Looker, camera, picture

BLIND_M = 0.5
RADIUS_M = 0.27


class NearSighted(Looker):
    """A TIAGo whose camera is blind within 0.5 m, next to a table top without legs."""

    def __init__(self, gap_m, camera_m, blind_m=BLIND_M):
        edge_m = RADIUS_M + gap_m
        table = ((-0.8, edge_m, 0.70), (0.8, edge_m + 0.9, 0.74))  # to the left
        super().__init__([FLOOR, table])
        self.gate = type(self.gate)(tiago_profile(has_depth=True, depth=DepthView(1.10, blind_m=blind_m)))
        self.to_base = camera(LOOK_AHEAD, height_m=camera_m)
        self.edge_m = edge_m

    def look(self):
        self.seed += 1
        shown = picture(self.boxes, self.to_base, at=self.pose, noise=0.0015, seed=self.seed)
        shown.ahead[shown.ahead < BLIND_M] = np.nan
        self.gate.observe_depth(
            frame_of(shown, self.to_base, self.gate.profile.depth), self.stamp_s, self.now_s
        )

    def turn(self, yaw, seconds=2.0):
        begin = self.pose.yaw
        steps = round(seconds / 0.1)
        for step in range(1, steps + 1):
            self.pose = self.pose._replace(yaw=begin + (yaw - begin) * step / steps)
            self.stand(0.1)

    def drive(self, speed, seconds=6.0, looks=True):
        if self.decide(speed).code == "behind_unseen":
            self.decide()  # the driver looks behind the robot, and pulls again
        for step in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.all()
            if step % 2 and looks:
                self.look()
            verdict = self.decide(speed)
            way = 0.05 * verdict.velocity.vx
            self.velocity = Velocity(verdict.velocity.vx, 0.0, 0.0)
            x, y, yaw = self.pose
            self.pose = Pose(x + way * math.cos(yaw), y + way * math.sin(yaw), yaw)

    @property
    def gap_m(self):
        return self.edge_m - self.pose.y - RADIUS_M


@pytest.mark.parametrize("gap_m", [0.04, 0.06, 0.10])
@pytest.mark.parametrize("camera_m", [1.067, 1.217])
def test_parked_at_a_table_turned_and_driven_it_does_not_touch(gap_m, camera_m):
    looker = NearSighted(gap_m, camera_m)
    looker.stand(0.5)
    looker.turn(math.pi / 2.0)
    looker.drive(0.5)
    assert looker.gap_m > 0.0


def test_a_table_whose_edge_was_seen_is_driven_up_to():
    looker = NearSighted(1.5, 1.217)
    looker.pose = Pose(0.0, 0.0, math.pi / 2.0)
    looker.stand(0.5)
    looker.drive(0.5)
    assert 0.0 < looker.gap_m < 0.2


def test_it_may_turn_away_and_back_off():
    looker = NearSighted(0.06, 1.067)
    looker.turn(math.pi / 2.0)
    assert looker.decide(0.5).velocity.vx < 0.05
    looker.drive(-0.2, seconds=2.0)
    assert looker.gap_m > 0.2


@pytest.mark.parametrize("gap_m", [0.04, 0.10])
@pytest.mark.parametrize("why", ["no pictures", "turned round"])
def test_an_unseen_near_side_stays_when_pictures_end(gap_m, why):
    looker = NearSighted(gap_m, 1.067)
    looker.turn(math.pi / 2.0)
    looker.stand(0.5)
    if why == "turned round":
        looker.turn(-math.pi / 2.0, seconds=4.0)
    looker.drive(0.5 if why == "no pictures" else -0.2, looks=why != "no pictures")
    assert looker.gap_m > 0.0


def test_a_hidden_near_side_goes_with_its_table():
    looker = NearSighted(0.06, 1.067)
    looker.turn(math.pi / 2.0)
    looker.stand(0.5)
    looker.turn(-math.pi / 2.0, seconds=4.0)
    looker.boxes = [FLOOR]
    looker.turn(math.pi / 2.0, seconds=4.0)
    looker.stand(1.0)
    assert looker.decide(0.5).velocity.vx > 0.2
