"""The whole simulated robot without ROS: the steps of one tick and their order. Times are seconds of one clock."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from robots.simulator.battery import Battery
from robots.simulator.faults import Faults
from robots.simulator.joints.arm import MOVED_BY, capsules
from robots.simulator.joints.frames import frames
from robots.simulator.joints.motions import Player, load_motions
from robots.simulator.physics.base import BaseController, Twist
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.physics.people import Walker
from robots.simulator.physics.wheels import Wheels
from robots.simulator.sensors.body import Body
from robots.simulator.sensors.laser import Laser, in_world
from robots.simulator.sensors.localisation import JUMP_M, Localisation
from robots.simulator.sensors.odometry import Drift, Odometry
from robots.simulator.sensors.sonar import Sonar
from robots.simulator.worlds import World

TICK_HZ = 50
TICK_S = 1.0 / TICK_HZ


class Robot:
    """Base, odometry, sensors, joints and battery over one `Physics`."""

    def __init__(self, world: World, body: Body, start: Pose, seed: int, drift: Drift) -> None:
        random = np.random.default_rng(seed)
        self.world = world
        self.body = body
        self.physics = Physics(world, body, start)
        self.controller = BaseController(body.limits)
        self.odometry = Odometry(drift, random)
        self.localisation = Localisation(self.odometry, np.random.default_rng(seed))
        self.laser = Laser(body.laser, random)
        self.sonars = [Sonar(mount, random) for mount in body.sonars]
        self.battery = Battery()
        self.people = {person.name: Walker(person) for person in world.people}
        self.wheels = Wheels(body.wheels) if body.wheels else None
        self.player = Player(load_motions() if body.upper_body else {})
        self.faults = Faults()
        self.approach = Twist()  # velocity before the last tick: the impact speed of present contacts
        self._frames = frames(body)
        self._arm_at: list[float] = []
        self._lay_arm()
        self._late: deque[tuple[float, Twist]] = deque()
        self._steps = round(TICK_S / self.physics.timestep_s)

    def map_to_odom(self) -> Pose | None:
        """Return the odometry frame's believed pose in the map frame; None: unknown."""
        if self.faults.localisation_dead or self.localisation.waits:
            return None
        x, y, yaw = self.localisation.map_to_odom(self.physics.pose)
        return Pose(x + JUMP_M, y, yaw) if self.faults.localisation_jumps else Pose(x, y, yaw)

    def believed(self) -> Pose | None:
        """Return the robot's believed pose in the map frame; None: unknown."""
        frame = self.map_to_odom()
        if frame is None:
            return None
        x, y = in_world(frame, self.odometry.x, self.odometry.y)
        return Pose(x, y, math.remainder(frame.yaw + self.odometry.yaw, math.tau))

    def command(self, twist: Twist, now: float) -> None:
        """Take a command for the base."""
        if self.faults.command_delay_s:
            self._late.append((now + self.faults.command_delay_s, twist))
        else:
            self.controller.command(twist, now)

    def tick(self, now: float) -> None:
        """Simulate the next `TICK_S` seconds."""
        while self._late and self._late[0][0] <= now:
            self.controller.command(self._late.popleft()[1], now)
        self._walk()
        self.approach = self.physics.velocity
        self.controller.brake_share = self.faults.brake_share
        wheels = self.controller.step(now, TICK_S)
        kept = 1.0 - self.faults.slip_share
        self.physics.step(Twist(wheels.vx * kept, wheels.vy * kept, wheels.w * kept), self._steps)
        moved = self.physics.velocity
        rolled = Twist(moved.vx / kept, moved.vy / kept, moved.w / kept)
        self.odometry.step(rolled, TICK_S)
        if self.wheels is not None:
            self.wheels.step(rolled, TICK_S)
        self.player.stuck = self.faults.joints_stuck
        self.player.step(now)
        self._lay_arm()
        self.battery.step(moved, TICK_S)

    def joints(self) -> dict[str, tuple[float, float]]:
        """Return position and velocity of each joint of this body."""
        moving: list[Wheels | Player] = [self.wheels] if self.wheels is not None else []
        if self.body.upper_body:
            moving.append(self.player)
        return {
            joint: (position, part.velocities[joint])
            for part in moving
            for joint, position in part.positions.items()
        }

    def _lay_arm(self) -> None:
        """Place the arm by the present joints, if they moved."""
        joints = self.player.positions
        at = [joints[name] for name in MOVED_BY]
        if self.body.upper_body and at != self._arm_at:
            self._arm_at = at
            self.physics.place_arm(capsules(self._frames, joints))

    def _walk(self) -> None:
        for name, walker in self.people.items():
            walker.step(TICK_S)
            self.physics.place_person(name, walker.x, walker.y, walker.yaw)
