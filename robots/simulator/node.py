"""The simulated robot as a node: a fixed-rate loop over `Robot` that serves its actions and publishes its topics."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from robots.simulator.robot import TICK_HZ, TICK_S, Robot
from robots.simulator.ros_side import NANO, RosSide, Stamp
from robots.simulator.topics.base import BaseTopics
from robots.simulator.topics.cameras.colour import CameraPublisher, head_camera, rear_camera
from robots.simulator.topics.cameras.depth import DepthPublisher
from robots.simulator.topics.cameras.drawing_thread import DrawingThread
from robots.simulator.topics.diagnostics import DiagnosticsTopic
from robots.simulator.topics.inertial import InertialTopics
from robots.simulator.topics.joints import JointTopics
from robots.simulator.topics.map import MapTopics
from robots.simulator.topics.power import PowerTopics
from robots.simulator.topics.sensors import LaserTopics, SonarTopic
from robots.simulator.topics.truth import GroundTruth

_LONGEST_LAG_S = 0.2


class Duty(NamedTuple):
    """A job that runs `rate_hz` times a second; `phase`, in ticks, spreads costly jobs over the ticks."""

    rate_hz: int
    phase: int
    run: Callable[[Stamp], None]

    def due(self, tick: int) -> bool:
        """Return whether the job runs in this tick."""
        return (tick - self.phase) * self.rate_hz % TICK_HZ < self.rate_hz


class CameraOptions(NamedTuple):
    """Encoding of depth, and whether the head's colour camera draws the clock code (`cameras.clock_code`)."""

    depth_encoding: str = "32FC1"
    clock: bool = False


class SimulatorNode:
    """Runs one robot until the stop event. `ros` and `ros2` add what is different in them, before `run`."""

    def __init__(self, ros: RosSide, robot: Robot, base: BaseTopics) -> None:
        self._ros = ros
        self._robot = robot
        self._tick = 0
        self._truth = GroundTruth(ros, robot)
        diagnostics = DiagnosticsTopic(ros, robot)
        self._servers: list[Callable[[float], None]] = []
        self._duties = [
            Duty(TICK_HZ, 0, base.publish),
            Duty(5, 6, MapTopics(ros, robot).publish),
            Duty(TICK_HZ, 0, JointTopics(ros, robot).publish),
            Duty(TICK_HZ, 0, InertialTopics(ros, robot).publish),
            Duty(1, 7, PowerTopics(ros, robot).publish),
            Duty(1, 8, diagnostics.publish),
            Duty(TICK_HZ, 0, diagnostics.flood),
            Duty(TICK_HZ, 0, self._truth.publish_contacts),
            Duty(TICK_HZ, 0, self._truth.publish_pose),
            Duty(25, 1, self._truth.publish_clearance),
        ]
        sonars = SonarTopic(ros, robot)
        for index, sonar in enumerate(robot.sonars):
            self.add(Duty(5, 3 * index + 1, partial(sonars.publish, sonar)))
        self._drawing_thread = DrawingThread(robot.physics)

    def add(self, *duties: Duty) -> None:
        """Add jobs, after those that it has."""
        self._duties += duties

    def serve(self, *steps: Callable[[float], None]) -> None:
        """Add servers, which run once a tick after the robot."""
        self._servers += steps

    def add_cameras(self, options: CameraOptions) -> None:
        """Add the cameras of this body."""
        ros, robot, thread = self._ros, self._robot, self._drawing_thread
        if robot.body.upper_body:
            depth = DepthPublisher(ros, robot, thread, options.depth_encoding)
            head = CameraPublisher(ros, robot, thread, head_camera(robot, clock=options.clock))
            self.add(Duty(10, 2, depth.publish), Duty(15, 4, head.publish))
        if robot.body.rear_camera is not None:
            rear = CameraPublisher(ros, robot, thread, rear_camera(robot.body, robot.body.rear_camera))
            self.add(Duty(10, 3, rear.publish))

    def add_laser(self) -> None:
        """Add the laser: last, so that everything else is advertised, and published, before a scan."""
        self.add(Duty(10, 0, LaserTopics(self._ros, self._robot).publish))

    def run(self, stop: threading.Event) -> None:
        """Tick at a fixed rate of the monotonic clock until `stop` is set."""
        due = time.monotonic()
        while not stop.wait(max(0.0, due - time.monotonic())):
            self.tick(time.monotonic())
            # After a long stall (a suspended machine) continue from now, without the missed ticks.
            due = max(due + TICK_S, time.monotonic() - _LONGEST_LAG_S)

    def tick(self, now: float) -> None:
        """Simulate one step and publish its results."""
        self._truth.step()
        self._robot.tick(now)
        for step in self._servers:
            step(now)
        stamp = self._ros.now() + round(self._robot.faults.clock_ahead_s * NANO)
        for duty in self._duties:
            if duty.due(self._tick):
                duty.run(stamp)
        self._tick += 1

    def close(self) -> None:
        """End all parts that have their own thread."""
        self._drawing_thread.close()


def node_name(robot: str) -> str:
    """Return the name of the node of a robot's simulator."""
    return re.sub(r"[^A-Za-z0-9_]", "_", f"simulator_{robot}")
