"""A sonar in the simulated world: the nearest object in its cone, except the floor.

A smooth floor reflects ultrasound away from a sonar that looks along it: it measures only objects on the floor.
"""

from __future__ import annotations

import math

import numpy as np

from robots.simulator.physics.mujoco_world import Physics
from robots.simulator.sensors.body import SonarMount
from robots.simulator.sensors.laser import in_world

_ACROSS = 9  # rays side by side in the cone
_UPRIGHT = 9  # and on top of each other
_FLOOR_M = 0.01  # hits lower than this are the floor


class Sonar:
    """Casts a bundle of rays and returns the shortest."""

    def __init__(self, mount: SonarMount, random: np.random.Generator) -> None:
        self.mount = mount
        self._random = random
        half = mount.fov / 2.0
        across, upright = np.meshgrid(np.linspace(-half, half, _ACROSS), np.linspace(-half, half, _UPRIGHT))
        self._across = across.ravel()
        self._sine = np.sin(upright.ravel())
        self._cosine = np.cos(upright.ravel())

    def range_m(self, physics: Physics) -> float:
        """Return the distance to the nearest object in the cone; the longest range without one."""
        x, y, z, yaw = self.mount.pose
        robot = physics.pose
        heading = self._across + (robot.yaw + yaw)
        directions = np.stack(
            (np.cos(heading) * self._cosine, np.sin(heading) * self._cosine, self._sine), axis=1
        )
        distance = physics.cast(np.array([*in_world(robot, x, y), z]), directions)
        hit = distance[(distance >= 0.0) & (z + distance * directions[:, 2] > _FLOOR_M)]
        nearest = float(hit.min()) if hit.size else math.inf
        if self.mount.lost_share and self._random.random() < self.mount.lost_share:
            nearest = math.inf
        measured = nearest + self.mount.sigma_m * float(self._random.standard_normal())
        return min(max(measured, self.mount.shortest_m), self.mount.longest_m)
