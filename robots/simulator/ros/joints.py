"""Joint states and the transforms of the robot's frames."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from robots.simulator.joints.frames import Frame, frames, moved
from robots.simulator.robot import Robot
from robots.simulator.ros.messages import stamped, transform


class JointTopics:
    """/joint_states, /tf of moving frames and /tf_static of fixed ones."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        table = frames(robot.body)
        self._movable = [frame for frame in table if frame.joint]
        self._states: rospy.Publisher | None = None
        if robot.joints():
            self._states = rospy.Publisher("/joint_states", JointState, queue_size=1, tcp_nodelay=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        self._fixed = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        now = rospy.Time.now()
        self._fixed.publish(TFMessage([_transform(frame, 0.0, now) for frame in table if not frame.joint]))

    def publish(self, stamp: rospy.Time) -> None:
        """Publish the joints."""
        dead = self._robot.faults.joints_dead
        if self._states is not None and self._states.get_num_connections() and not dead:
            self._states.publish(self._message(stamp))
        if self._movable and self._tf.get_num_connections():
            positions = self._robot.player.positions
            self._tf.publish(
                TFMessage([_transform(frame, positions[str(frame.joint)], stamp) for frame in self._movable])
            )

    def _message(self, stamp: rospy.Time) -> JointState:
        joints = self._robot.joints()
        positions, velocities = zip(*joints.values(), strict=True)
        message = JointState(
            name=list(joints), position=positions, velocity=velocities, effort=[0.0] * len(joints)
        )
        message.header.stamp = stamp
        return message


def _transform(frame: Frame, position: float, stamp: rospy.Time) -> TransformStamped:
    translation, rotation = moved(frame, position)
    return stamped(transform(frame.child, Vector3(*translation), Quaternion(*rotation)), stamp, frame.parent)
