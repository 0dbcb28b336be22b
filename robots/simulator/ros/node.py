"""The simulated robot as one ROS node: a fixed-rate loop over `Robot` that tells its topics."""

from __future__ import annotations

import logging
import threading
import time

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import rospy

from robots.simulator.robot import TICK_S, Robot
from robots.simulator.ros.base import BaseTopics
from robots.simulator.ros.sensors import LaserTopics

log = logging.getLogger(__name__)

_SCAN_EVERY = 5  # ticks: 10 Hz


class SimulatorNode:
    """Runs one robot until told to stop."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._base = BaseTopics(robot)
        self._laser = LaserTopics(robot)
        self._tick = 0

    def run(self, stop: threading.Event) -> None:
        """Tick at a fixed rate of the monotonic clock until `stop` is set."""
        due = time.monotonic()
        while not stop.wait(max(0.0, due - time.monotonic())):
            self.tick()
            # After a stall (a suspended machine) carry on from now: the past is not replayed.
            due = max(due + TICK_S, time.monotonic() - TICK_S)

    def tick(self) -> None:
        """One step of the robot's life, and what it tells about it."""
        self._robot.tick(time.monotonic())
        stamp = rospy.Time.now()
        self._base.publish(stamp)
        if self._tick % _SCAN_EVERY == 0:
            self._laser.publish(stamp)
        self._tick += 1
