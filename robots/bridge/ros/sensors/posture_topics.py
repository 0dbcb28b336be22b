"""The topics of joint states, and of goals of the motion server."""

from __future__ import annotations

from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus

from robots.bridge.robot.sensors.joints import EVERY_S, JointReception
from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.sensors.brief import JointStates
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class

RESTS_S = 0.2  # between two reads of joint states while nobody has control
JOINTS_WAIT = 10  # messages of one publisher: each may report other joints


class PostureTopics:
    """The topics of joints and arm."""

    def __init__(self, reception: JointReception) -> None:
        self._reception = reception
        self._joints = JointStates()

    def subscribe(self, joint_states: Topic, motions: Topic | None) -> list[rospy.Subscriber]:
        """Subscribe to joint states and, with `motions`, to the motion server's goals and results."""
        expect(joint_states.name, "sensor_msgs/JointState")
        pause(joint_states.name, lambda: RESTS_S, hurried_s=EVERY_S)
        subscribers = [
            rospy.Subscriber(joint_states.name, rospy.AnyMsg, self._on_joints, queue_size=JOINTS_WAIT)
        ]
        if motions:
            kind = motions.type.removesuffix("Action")
            for part, listener in (("goal", self._begun), ("result", self._ended)):
                topic, type_ = f"{motions.name}/{part}", f"{kind}Action{part.capitalize()}"
                subscribers.append(rospy.Subscriber(topic, message_class(type_), listener, queue_size=10))
        return subscribers

    # --- on rospy's threads ------------------------------------------------------------------------

    def _on_joints(self, raw: Any) -> None:
        self._reception.joints(self._joints.positions(raw._buff))

    def _begun(self, goal: Any) -> None:
        self._reception.begun(goal.goal_id.id, goal.goal.motion_name)

    def _ended(self, result: Any) -> None:
        status = result.status
        self._reception.ended(status.goal_id.id, status.status == GoalStatus.SUCCEEDED)
