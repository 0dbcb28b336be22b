"""A narrow door is passed in time although the odometry drifts: walls are remembered where they were seen last."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.shared.configuration.gate_profile import Parameters
from robots.shared.geometry.planar import wrapped
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import tiago_profile
from tests.gate.world import World, doorway

DRIFT, DRIFT_RAD_PER_M = 0.03, 0.02
NEAR_M, LAG = 0.15, 2
TURN_RADPS = 2.0944


class Drifting(World):
    """A robot whose odometry reports wrong ways and turns."""

    def __post_init__(self):
        super().__post_init__()
        random = np.random.default_rng([self.seed, 7])
        self.way, self.turn = 1.0 + random.uniform(-DRIFT, DRIFT, 2)
        self.bend = random.uniform(-DRIFT_RAD_PER_M, DRIFT_RAD_PER_M)
        self.reported = self.pose

    def move(self):
        before, there = self.pose, self.reported
        super().move()
        way_m = self.way * math.hypot(self.pose.x - before.x, self.pose.y - before.y)
        turned = self.turn * wrapped(self.pose.yaw - before.yaw) + self.bend * way_m
        heading = there.yaw + turned / 2.0
        self.reported = Pose(
            there.x + way_m * math.cos(heading),
            there.y + way_m * math.sin(heading),
            wrapped(there.yaw + turned),
        )

    @property
    def odometry(self):
        return self.reported


class Driver:
    """Competent: drives forward through points, and sees the robot with a short delay."""

    def __init__(self, points, mps):
        self.points, self.mps = list(points), mps
        self.poses = []

    def __call__(self, world):
        self.poses = [*self.poses[-LAG:], world.pose]
        pose = self.poses[0]
        while self.points and math.hypot(self.points[0][0] - pose.x, self.points[0][1] - pose.y) < NEAR_M:
            self.points.pop(0)
        if not self.points:
            return STILL
        off = wrapped(math.atan2(self.points[0][1] - pose.y, self.points[0][0] - pose.x) - pose.yaw)
        ahead = max(math.cos(2.0 * off), 0.0) if abs(off) < 0.8 else 0.0
        return Velocity(
            ahead * self.mps, 0.0, min(max(1.5 * off, -self.mps * TURN_RADPS), self.mps * TURN_RADPS)
        )


@pytest.mark.parametrize(("degrees", "noise_m", "seed"), [(95, 0.01, 4), (95, 0.01, 5), (110, 0.01, 8)])
def test_a_door_of_64_cm_is_passed_with_a_drifting_odometry(degrees, noise_m, seed):
    """Without drift it takes 12 s. Places that drifted into the door held the robot for up to 30 s."""
    random = np.random.default_rng([seed, 8])
    start = Pose(0.0, random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3))
    world = Drifting(
        tiago_profile(parameters=Parameters()),
        doorway(2.0, 0.64, 0.12),
        seed,
        start,
        half_view=math.radians(degrees),
        noise_m=noise_m,
        sonar_noise_m=0.02,
    )
    driver = Driver([(1.3, 0.0), (2.5, 0.0), (3.5, 0.0)], 0.3)
    began_s = world.now_s
    while driver.points and world.now_s < began_s + 16.0:
        world.drive(driver, 0.05)
    assert not driver.points, f"stuck at {world.pose}"
    assert world.least_gap_m > 0.02
