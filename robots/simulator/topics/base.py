"""The base's topics: velocity inputs through the mux, the controller's command topic, odometry and tf."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

from robots.simulator.physics import mux
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.topics.messages import odometry, transform, yaw_quaternion
from robots.simulator.topics.velocities import Velocities

log = logging.getLogger(__name__)

COMPLAIN_S = 5.0


class BaseTopics:
    """Subscribes to velocities and locks, publishes odometry. `inputs`: the mux's before `command`; none: no mux."""

    def __init__(
        self, ros: RosSide, robot: Robot, command: str, inputs: Mapping[str, int], velocities: Velocities
    ) -> None:
        self._ros = ros
        self._robot = robot
        self._velocities = velocities
        # 100, as in diff_drive_controller: on a busy computer messages may be late, but none is lost.
        self._odometry = ros.publisher(robot.body.names.odometry, "nav_msgs/Odometry", queue=100)
        self._tf = ros.publisher("/tf", "tf2_msgs/TFMessage", queue=10)
        self._frozen: Any = None
        self._complained_s = -math.inf
        if inputs:
            self._mux = MuxTopics(ros, command, inputs, velocities.kind)
        ros.subscribe(command, velocities.kind, self._commanded, queue=1)

    def publish(self, stamp: Stamp) -> None:
        """Publish odometry and the transform from odom to the base, as of `stamp`."""
        if self._robot.faults.odom_dead:
            return
        if self._odometry.wanted:
            self._odometry.publish(self._odometry_message(stamp))
        if self._tf.wanted:
            self._tf.publish(self._ros.new("tf2_msgs/TFMessage", transforms=[self._transform(stamp)]))

    def _odometry_message(self, stamp: Stamp) -> Any:
        if self._frozen is None or not self._robot.faults.odom_frozen:
            measured = self._robot.odometry
            frame = self._robot.body.names.base_frame
            message = odometry(self._ros, measured.pose, measured.velocity, frame)
            self._frozen = self._ros.stamped(message, stamp, "odom")
        return self._frozen

    def _transform(self, stamp: Stamp) -> Any:
        x, y, yaw = self._robot.odometry.pose
        turned = yaw_quaternion(self._ros, yaw)
        moved = transform(self._ros, self._robot.body.names.base_frame, (x, y, 0.0), turned)
        return self._ros.stamped(moved, stamp, "odom")

    def _commanded(self, message: Any) -> None:
        now = time.monotonic()
        twist = self._velocities.read(message, self._robot.faults.clock_ahead_s)
        if twist is not None and all(map(math.isfinite, twist)):
            self._robot.command(twist, now)
        elif now - self._complained_s > COMPLAIN_S:
            # diff_drive_controller ignores such commands too.
            self._complained_s = now
            log.warning("ignored a velocity command that is not a number, or too old")


class MuxTopics:
    """twist_mux: the velocity inputs and locks before the controller's command topic."""

    def __init__(self, ros: RosSide, command_topic: str, inputs: Mapping[str, int], kind: str) -> None:
        self._mux = mux.TwistMux(inputs)
        self._guard = threading.Lock()  # rospy calls back on one thread per connection
        self._through = ros.publisher(command_topic, kind)
        for name in inputs:
            ros.subscribe(f"/{name}", kind, partial(self._heard, name=name), queue=1)
        for name in mux.TIAGO_LOCKS:
            ros.subscribe(f"/{name}", "std_msgs/Bool", partial(self._locked, name=name))

    def _heard(self, message: Any, name: str) -> None:
        with self._guard:
            passes = self._mux.passes(name, time.monotonic())
        if passes:
            self._through.publish(message)

    def _locked(self, message: Any, name: str) -> None:
        with self._guard:
            self._mux.lock(name, message.data)
