"""Estimates the odometry frame's pose in the map frame, like a localisation by laser (amcl)."""

from __future__ import annotations

import math

import numpy as np

from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.sensors.odometry import Odometry

MOVED_M = 0.2  # a new estimate after this distance, or after `TURNED_RAD`
TURNED_RAD = 0.3
SIGMA_M = 0.02
SIGMA_RAD = 0.005
GIVEN_M = 0.5  # standard deviations after a person has set the pose, until the robot has moved
GIVEN_RAD = 0.26
FOUND_M = 0.8  # localisation finds the true pose if the set pose is off by less than this
FOUND_RAD = 0.6
JUMP_M = 1.5  # the fault `localisation_jumps`


class Localisation:
    """Estimates the robot's pose again each time it has moved; odometry is used in between. World frame = map frame."""

    def __init__(self, odometry: Odometry, random: np.random.Generator) -> None:
        self._odometry = odometry
        self._random = random
        self._believed_at: Pose | None = None  # in the odometry's frame
        self._map_to_odom = Pose(0.0, 0.0, 0.0)
        self._is_given = False  # set by a person, and not yet confirmed
        self._is_lost = False
        self.waits = False  # the pose is unknown until a person sets it

    @property
    def sigmas(self) -> tuple[float, float]:
        """Standard deviations of the believed pose: metres and radians."""
        return (GIVEN_M, GIVEN_RAD) if self._is_given else (SIGMA_M, SIGMA_RAD)

    def give(self, pose: Pose, truth: Pose) -> None:
        """Take the map pose that a person has set. If it is far from the true pose, the robot stays lost."""
        self._believed_at = self._odometry.pose
        self._set(*pose, self._believed_at)
        self._is_given, self.waits = True, False
        turned = abs(math.remainder(pose.yaw - truth.yaw, math.tau))
        self._is_lost = math.dist(pose[:2], truth[:2]) > FOUND_M or turned > FOUND_RAD

    def look_again(self) -> None:
        """Estimate at once: somebody carried the robot. Else its next drive would begin with a jump of its pose."""
        self._believed_at = None

    def map_to_odom(self, truth: Pose) -> Pose:
        """Return the odometry frame's pose in the map frame, for the robot's true pose `truth`."""
        odometry = self._odometry.pose
        if self._believed_at is None or _moved(self._believed_at, odometry):
            self._believed_at = odometry
            if not self._is_lost:
                self._is_given = False
                x, y, yaw = np.array(truth) + self._random.normal(0.0, (SIGMA_M, SIGMA_M, SIGMA_RAD))
                self._set(float(x), float(y), float(yaw), odometry)
        return self._map_to_odom

    def _set(self, x: float, y: float, yaw: float, odometry: Pose) -> None:
        """Set the transform from the robot's pose `odometry` in the odometry frame to this pose in the map."""
        turn = math.remainder(yaw - odometry.yaw, math.tau)
        c, s = math.cos(turn), math.sin(turn)
        self._map_to_odom = Pose(
            x - c * odometry.x + s * odometry.y, y - s * odometry.x - c * odometry.y, turn
        )


def _moved(before: Pose, now: Pose) -> bool:
    turned = abs(math.remainder(now.yaw - before.yaw, math.tau))
    return math.dist(before[:2], now[:2]) > MOVED_M or turned > TURNED_RAD
