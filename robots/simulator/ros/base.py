"""The base's topics: velocity inputs through the mux, the controller's command topic, odometry and tf."""

from __future__ import annotations

import math
import threading
import time
from functools import partial

import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from robots.simulator.physics import base, mux
from robots.simulator.robot import Robot


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return the rotation by `yaw` about the vertical."""
    return Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))


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
            self._frozen = self._message(stamp)
        return self._frozen

    def _message(self, stamp: rospy.Time) -> Odometry:
        odometry = self._robot.odometry
        message = Odometry()
        message.header.stamp = stamp
        message.header.frame_id = "odom"
        message.child_frame_id = self._robot.body.names.base_frame
        message.pose.pose.position.x = odometry.x
        message.pose.pose.position.y = odometry.y
        message.pose.pose.orientation = yaw_quaternion(odometry.yaw)
        message.twist.twist.linear.x = odometry.velocity.vx
        message.twist.twist.linear.y = odometry.velocity.vy
        message.twist.twist.angular.z = odometry.velocity.w
        return message

    def _transform(self, stamp: rospy.Time) -> TransformStamped:
        odometry = self._robot.odometry
        transform = TransformStamped()
        transform.header.stamp = stamp
        transform.header.frame_id = "odom"
        transform.child_frame_id = self._robot.body.names.base_frame
        transform.transform.translation.x = odometry.x
        transform.transform.translation.y = odometry.y
        transform.transform.rotation = yaw_quaternion(odometry.yaw)
        return transform

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
