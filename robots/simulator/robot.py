"""The whole simulated robot but for ROS: what happens in one tick, in which order. Times are seconds of one clock."""

from __future__ import annotations

import numpy as np

from robots.simulator.base import BaseController, Twist
from robots.simulator.body import Body
from robots.simulator.laser import Laser
from robots.simulator.odometry import Drift, Odometry
from robots.simulator.physics import Physics, Pose
from robots.simulator.worlds import World

TICK_HZ = 50
TICK_S = 1.0 / TICK_HZ


class Robot:
    """Base, odometry and sensors over one `Physics`."""

    def __init__(self, world: World, body: Body, start: Pose, seed: int, drift: Drift) -> None:
        random = np.random.default_rng(seed)
        self.body = body
        self.physics = Physics(world, body, start)
        self.controller = BaseController(body.limits)
        self.odometry = Odometry(drift, random)
        self.laser = Laser(body.laser, random)
        self._steps = round(TICK_S / self.physics.timestep_s)

    def command(self, twist: Twist, now: float) -> None:
        """A command reached the base controller."""
        self.controller.command(twist, now)

    def tick(self, now: float) -> None:
        """Live through the next `TICK_S` seconds."""
        wanted = self.controller.step(now, TICK_S)
        self.physics.step(wanted, self._steps)
        self.odometry.step(self.physics.velocity, TICK_S)
