"""The base's topics: velocity inputs through the mux, the controller's command topic, odometry and tf."""

from __future__ import annotations

import math
import threading
import time
from functools import partial

import rospy
from geometry_msgs.msg import TransformStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from robots.simulator.physics import base, mux
from robots.simulator.robot import Robot
from robots.simulator.ros.messages import odometry, stamped, transform, yaw_quaternion


class BaseTopics:
    """Subscribes to velocities and locks, publishes odometry."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        names = robot.body.names
        # 100, as in diff_drive_controller: on a busy computer messages may be late, but none is lost.
        self._odometry = rospy.Publisher(names.odometry, Odometry, queue_size=100, tcp_nodelay=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        self._frozen: Odometry | None = None
        if names.mux:
            self._mux = MuxTopics(names.command)
        rospy.Subscriber(names.command, Twist, self._commanded, queue_size=1, tcp_nodelay=True)

    def publish(self, stamp: rospy.Time) -> None:
        """Publish odometry and the transform from odom to the base, as of `stamp`."""
        if self._robot.faults.odom_dead:
            return
        if self._odometry.get_num_connections():
            self._odometry.publish(self._odometry_message(stamp))
        if self._tf.get_num_connections():
            self._tf.publish(TFMessage([self._transform(stamp)]))

    def _odometry_message(self, stamp: rospy.Time) -> Odometry:
        if self._frozen is None or not self._robot.faults.odom_frozen:
            measured = self._robot.odometry
            message = odometry(measured.pose, measured.velocity, self._robot.body.names.base_frame)
            self._frozen = stamped(message, stamp, "odom")
        return self._frozen

    def _transform(self, stamp: rospy.Time) -> TransformStamped:
        x, y, yaw = self._robot.odometry.pose
        moved = transform(self._robot.body.names.base_frame, Vector3(x, y, 0.0), yaw_quaternion(yaw))
        return stamped(moved, stamp, "odom")

    def _commanded(self, message: Twist) -> None:
        twist = base.Twist(message.linear.x, message.linear.y, message.angular.z)
        if not all(map(math.isfinite, twist)):
            # diff_drive_controller ignores such commands too.
            rospy.logwarn_throttle(5.0, "ignored a velocity command that is not a number")
            return
        self._robot.command(twist, time.monotonic())


class MuxTopics:
    """twist_mux: the velocity inputs and locks before the controller's command topic."""

    def __init__(self, command_topic: str) -> None:
        self._mux = mux.TwistMux()
        self._guard = threading.Lock()  # rospy calls back on one thread per connection
        self._through = rospy.Publisher(command_topic, Twist, queue_size=1, tcp_nodelay=True)
        for name in mux.TIAGO_INPUTS:
            rospy.Subscriber(
                f"/{name}", Twist, partial(self._heard, name=name), queue_size=1, tcp_nodelay=True
            )
        for name in mux.TIAGO_LOCKS:
            rospy.Subscriber(f"/{name}", Bool, partial(self._locked, name=name))

    def _heard(self, message: Twist, name: str) -> None:
        with self._guard:
            passes = self._mux.passes(name, time.monotonic())
        if passes:
            self._through.publish(message)

    def _locked(self, message: Bool, name: str) -> None:
        with self._guard:
            self._mux.lock(name, message.data)
