"""Sends the head's aim: to the robot's head action while a server listens to it, else to the head's controller."""

from __future__ import annotations

from typing import Any
from uuid import uuid4

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.bridge.head.head import Aim
from robots.bridge.head.head_tasks import HeadMover, HeadTasks
from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.tasks.actions import ended
from robots.bridge.ros.tasks.publishing import heard_by, publish
from robots.bridge.tasks.goals import OURS
from robots.shared.configuration.bridge_config import POINT_HEAD, HeadSource
from robots.shared.ros.message_types.classes import message_class


class HeadTopics(HeadMover, RobotPart):
    """The topics of one head. Its controller takes joint positions, its action a point to look at."""

    def __init__(self, node: Node, source: HeadSource) -> None:
        self._source = source
        self._node = node
        self._controller = rospy.Publisher(source.topic, JointTrajectory, queue_size=1)
        self._action: rospy.Publisher | None = None
        if source.point_head is not None:
            self._goal_class = message_class(f"{POINT_HEAD}Goal")
            self._action = rospy.Publisher(f"{source.point_head}/goal", self._goal_class, queue_size=1)
            # Only an action server publishes a status. A recorder listens to goals too, but moves no head.
            status = f"{source.point_head}/status"
            expect(status, "actionlib_msgs/GoalStatusArray")
            self._server = rospy.Subscriber(status, rospy.AnyMsg, lambda _status: None, queue_size=1)
            result_class = message_class(f"{POINT_HEAD}Result")
            rospy.Subscriber(f"{source.point_head}/result", result_class, self._on_result, queue_size=10)

    @classmethod
    def of(cls, node: Node) -> HeadTopics | None:
        head = node.config.topics.head
        return cls(node, head) if head else None

    def head_at(self) -> tuple[float, float] | None:
        pan, tilt = self._node.joint(self._source.pan_joint), self._node.joint(self._source.tilt_joint)
        return None if pan is None or tilt is None else (pan, tilt)

    def aim_head(self, aim: Aim) -> str | None:
        if self._action is not None and heard_by(self._action) and self._server.get_num_connections():
            goal_id = f"{OURS}head-{uuid4()}"
            publish(self._action, self._goal(aim, goal_id))
            return goal_id
        publish(self._controller, self._trajectory(aim))
        return None

    def _on_result(self, message: Any) -> None:
        """Take the end of a goal, on a thread of rospy."""
        goal_id, outcome, text = ended(message)
        self._node.mail.post(
            (self._source.point_head, "ended"),
            lambda: self._node.tasks.part(HeadTasks).ended(goal_id, outcome, text),
            EVENTS_WAIT,
        )

    def _trajectory(self, aim: Aim) -> JointTrajectory:
        point = JointTrajectoryPoint(
            positions=[aim.pan, aim.tilt], time_from_start=rospy.Duration.from_sec(aim.seconds)
        )
        joints = [self._source.pan_joint, self._source.tilt_joint]
        return JointTrajectory(joint_names=joints, points=[point])

    def _goal(self, aim: Aim, goal_id: str) -> object:
        """Return the goal that points the head's own axis (the action's default) in this direction."""
        now = rospy.Time.now()
        goal = self._goal_class(goal_id=GoalID(stamp=now, id=goal_id))
        goal.header = Header(stamp=now)
        goal.goal.target = PointStamped(
            # Stamp 0: the newest transform. The base's own clock may be ahead.
            header=Header(frame_id=self._source.base_frame),
            point=Point(*aim.point),
        )
        goal.goal.min_duration = rospy.Duration.from_sec(aim.seconds)
        return goal
