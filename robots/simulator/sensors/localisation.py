"""Estimates the odometry frame's pose in the map frame, like a localisation by laser (amcl)."""

from __future__ import annotations

import math

import numpy as np

from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.sensors.odometry import Odometry

MOVED_M = 0.2  # a new estimate after this, or
TURNED_RAD = 0.3
SIGMA_M = 0.02
SIGMA_RAD = 0.005


class Localisation:
    """Estimates the robot's pose again each time it has moved; odometry is used in between. World frame = map frame."""

    def __init__(self, odometry: Odometry, random: np.random.Generator) -> None:
        self._odometry = odometry
        self._random = random
        self._believed_at: Pose | None = None  # in the odometry's frame
        self._map_to_odom = Pose(0.0, 0.0, 0.0)

    def map_to_odom(self, truth: Pose) -> Pose:
        """Return the odometry frame's pose in the map frame, for the robot's true pose `truth`."""
        odometry = Pose(self._odometry.x, self._odometry.y, self._odometry.yaw)
        if self._believed_at is None or _moved(self._believed_at, odometry):
            self._believed_at = odometry
            x, y, yaw = np.array(truth) + self._random.normal(0.0, (SIGMA_M, SIGMA_M, SIGMA_RAD))
            turn = math.remainder(yaw - odometry.yaw, math.tau)
            c, s = math.cos(turn), math.sin(turn)
            self._map_to_odom = Pose(
                x - c * odometry.x + s * odometry.y, y - s * odometry.x - c * odometry.y, turn
            )
        return self._map_to_odom


def _moved(before: Pose, now: Pose) -> bool:
    turned = abs(math.remainder(now.yaw - before.yaw, math.tau))
    return math.dist(before[:2], now[:2]) > MOVED_M or turned > TURNED_RAD
