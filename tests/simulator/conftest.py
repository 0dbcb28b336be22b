"""Simulated robots in small rooms of known size."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robots.simulator.physics.base import Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import TICK_S, Robot
from robots.simulator.sensors.body import BODIES
from robots.simulator.sensors.odometry import Drift
from robots.simulator.worlds import Wall, World

NO_DRIFT = Drift().times(0.0)
ORIGIN = Pose(0.0, 0.0, 0.0)


def room(**things) -> World:
    """A room of 4 m by 4 m around the origin, inner faces at +-2 m, with `things` in it."""
    corners = [(-2.05, -2.05), (2.05, -2.05), (2.05, 2.05), (-2.05, 2.05)]
    sides = zip(("south", "east", "north", "west"), corners, corners[1:] + corners[:1], strict=True)
    walls = [Wall(name=f"{side} wall", start=start, end=end) for side, start, end in sides]
    return World(name="room", size=(-3.0, -3.0, 3.0, 3.0), walls=walls, **things)


class Driven:
    """A robot whose clock advances only in `drive` and `wait`."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.now = 0.0

    def drive(self, twist: Twist, seconds: float) -> None:
        """Repeat `twist` for `seconds`."""
        for _ in range(round(seconds / TICK_S)):
            self.robot.command(twist, self.now)
            self.robot.tick(self.now)
            self.now += TICK_S

    def wait(self, seconds: float) -> None:
        """Send nothing for `seconds`."""
        for _ in range(round(seconds / TICK_S)):
            self.robot.tick(self.now)
            self.now += TICK_S


@pytest.fixture
def robot_in() -> Callable[..., Driven]:
    """``robot_in(world, pose=ORIGIN, base="tiago", seed=0, drift=NO_DRIFT)``."""

    def make(world, pose=ORIGIN, base="tiago", seed=0, drift=NO_DRIFT) -> Driven:
        return Driven(Robot(world, BODIES[base], pose, seed, drift))

    return make
