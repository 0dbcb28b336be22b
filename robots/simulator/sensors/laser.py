"""A planar laser in the simulated world, with a real laser's faults: noise, drop-outs, too near, too far."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import LaserMount

_BLANKED_M = 0.30


class Laser:
    """Casts the rays of one laser."""

    def __init__(self, mount: LaserMount, random: np.random.Generator) -> None:
        self.mount = mount
        self._random = random
        self.angles = np.linspace(-mount.half_angle, mount.half_angle, mount.rays)
        self._directions = np.zeros((mount.rays, 3))

    @property
    def increment(self) -> float:
        """The angle (rad) between neighbouring rays."""
        return 2.0 * self.mount.half_angle / (self.mount.rays - 1)

    def scan(self, physics: Physics) -> NDArray[np.float32]:
        """Return the range (m) of each ray: nan dropped out, -inf nearer than the laser can measure, +inf no hit."""
        x, y, z, yaw = self.mount.pose
        robot = physics.pose
        origin = np.array([*in_world(robot, x, y), z])
        heading = self.angles + (robot.yaw + yaw)
        np.cos(heading, out=self._directions[:, 0])
        np.sin(heading, out=self._directions[:, 1])
        return self._as_measured(physics.cast(origin, self._directions))

    def _as_measured(self, distance: NDArray[np.float64]) -> NDArray[np.float32]:
        mount = self.mount
        ranges = distance + self._random.normal(0.0, mount.sigma_m, distance.shape)
        ranges[ranges < mount.shortest_m] = -np.inf
        ranges[(distance < 0.0) | (ranges > mount.longest_m)] = np.inf
        ranges[self._random.random(ranges.shape) < mount.dropout_share] = np.nan
        return ranges.astype(np.float32)

    def blanked(self, ranges: NDArray[np.float32]) -> NDArray[np.float32]:
        """Drop points within a square of +-0.30 m about the base, as PAL's filter for /scan does."""
        x, y, _, yaw = self.mount.pose
        with np.errstate(invalid="ignore"):
            across = np.abs(x + ranges * np.cos(self.angles + yaw))
            along = np.abs(y + ranges * np.sin(self.angles + yaw))
            inside = (across < _BLANKED_M) & (along < _BLANKED_M)
        return np.where(inside, np.float32(np.nan), ranges)


def in_world(robot: Pose, x: float, y: float) -> tuple[float, float]:
    """Return a point of the base frame in the world's frame."""
    cos, sin = math.cos(robot.yaw), math.sin(robot.yaw)
    return robot.x + cos * x - sin * y, robot.y + sin * x + cos * y
