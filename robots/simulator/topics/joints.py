"""Joint states and the transforms of the robot's frames."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from robots.simulator.joints.frames import Frame, frames, moved
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.topics.messages import transform


class JointTopics:
    """/joint_states, /tf of moving frames and /tf_static of fixed ones."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        table = frames(robot.body)
        self._movable = [frame for frame in table if frame.joint]
        self._states = ros.publisher("/joint_states", "sensor_msgs/JointState") if robot.joints() else None
        self._tf = ros.publisher("/tf", "tf2_msgs/TFMessage", queue=10)
        self._fixed = ros.publisher("/tf_static", "tf2_msgs/TFMessage", kept=True)
        fixed = [(frame, 0.0) for frame in table if not frame.joint]
        self._fixed.publish(self._transforms(fixed, ros.now()))

    def publish(self, stamp: Stamp) -> None:
        """Publish the joints."""
        dead = self._robot.faults.joints_dead
        if self._states is not None and self._states.wanted and not dead:
            self._states.publish(self._message(stamp))
        if self._movable and self._tf.wanted:
            positions = self._robot.player.positions
            placed = [(frame, positions[str(frame.joint)]) for frame in self._movable]
            self._tf.publish(self._transforms(placed, stamp))

    def _message(self, stamp: Stamp) -> Any:
        joints = self._robot.joints()
        positions, velocities = zip(*joints.values(), strict=True)
        message = self._ros.new(
            "sensor_msgs/JointState",
            name=list(joints),
            position=list(positions),
            velocity=list(velocities),
            effort=[0.0] * len(joints),
        )
        return self._ros.stamped(message, stamp)

    def _transforms(self, placed: Iterable[tuple[Frame, float]], stamp: Stamp) -> Any:
        """Return the message about these frames at these positions of their joints."""
        transforms = []
        for frame, position in placed:
            at, (x, y, z, w) = moved(frame, position)
            turned = self._ros.new("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)
            transforms.append(
                self._ros.stamped(transform(self._ros, frame.child, at, turned), stamp, frame.parent)
            )
        return self._ros.new("tf2_msgs/TFMessage", transforms=transforms)
