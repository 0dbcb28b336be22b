"""The base's topics: velocity inputs through the mux, the controller's command topic, odometry and tf."""

from __future__ import annotations

import math
import threading
import time
from functools import partial

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from robots.simulator import base, mux
from robots.simulator.robot import Robot

COMMAND_TOPIC = "/mobile_base_controller/cmd_vel"
ODOMETRY_TOPIC = "/mobile_base_controller/odom"


def yaw_quaternion(yaw: float) -> Quaternion:
    """The rotation by `yaw` about the vertical."""
    return Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))


class BaseTopics:
    """Listens for velocities and locks, tells odometry."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._mux = mux.TwistMux()
        self._mux_lock = threading.Lock()  # rospy calls back on one thread per connection
        self._through = rospy.Publisher(COMMAND_TOPIC, Twist, queue_size=1, tcp_nodelay=True)
        self._odometry = rospy.Publisher(ODOMETRY_TOPIC, Odometry, queue_size=1, tcp_nodelay=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        for name in mux.TIAGO_INPUTS:
            rospy.Subscriber(f"/{name}", Twist, partial(self._heard, name), queue_size=1, tcp_nodelay=True)
        for name in mux.TIAGO_LOCKS:
            rospy.Subscriber(f"/{name}", Bool, partial(self._locked, name))
        rospy.Subscriber(COMMAND_TOPIC, Twist, self._commanded, queue_size=1, tcp_nodelay=True)

    def publish(self, stamp: rospy.Time) -> None:
        """Tell odometry and the transform from odom to the base, as of `stamp`."""
        told = self._robot.odometry
        turned = yaw_quaternion(told.yaw)
        if self._odometry.get_num_connections():
            message = Odometry()
            message.header.stamp = stamp
            message.header.frame_id = "odom"
            message.child_frame_id = "base_footprint"
            message.pose.pose.position.x = told.x
            message.pose.pose.position.y = told.y
            message.pose.pose.orientation = turned
            message.twist.twist.linear.x = told.velocity.vx
            message.twist.twist.linear.y = told.velocity.vy
            message.twist.twist.angular.z = told.velocity.w
            self._odometry.publish(message)
        if self._tf.get_num_connections():
            transform = TransformStamped()
            transform.header.stamp = stamp
            transform.header.frame_id = "odom"
            transform.child_frame_id = "base_footprint"
            transform.transform.translation.x = told.x
            transform.transform.translation.y = told.y
            transform.transform.rotation = turned
            self._tf.publish(TFMessage([transform]))

    def _heard(self, name: str, message: Twist) -> None:
        with self._mux_lock:
            passes = self._mux.passes(name, time.monotonic())
        if passes:
            self._through.publish(message)

    def _locked(self, name: str, message: Bool) -> None:
        with self._mux_lock:
            self._mux.lock(name, message.data)

    def _commanded(self, message: Twist) -> None:
        twist = base.Twist(message.linear.x, message.linear.y, message.angular.z)
        if not all(map(math.isfinite, twist)):
            rospy.logwarn_throttle(
                5.0, "not a number in a velocity command: ignored, as diff_drive_controller does"
            )
            return
        self._robot.command(twist, time.monotonic())
