"""Joint states and goals of the motion server, for the arm's posture.

Joint states come fifty times a second. A rospy thread reads ten of them a second and reports the posture.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.gate.arm.discs import Posture
from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.sensors.brief import JointStates
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.texts import NAME, cut

EVERY_S, RESTS_S = 0.1, 0.2  # while somebody has control; else
JOINTS_WAIT = 10  # messages of one publisher: each may report other joints

Take = Callable[[Posture, float], None]


class PostureTopics:
    """The topics of joints and arm. With an arm, a rospy thread calls `take` with posture and arrival time."""

    def __init__(self, arm: ArmPosture, take: Take | None) -> None:
        self._arm = arm
        self._take = take
        self._joints = JointStates()
        self._reported_s = float("-inf")

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
        now_s = time.monotonic()
        self._arm.update(self._joints.positions(raw._buff), now_s)
        if self._take is not None and now_s - self._reported_s >= EVERY_S:
            self._reported_s = now_s
            self._take(self._arm.posture(now_s), now_s)

    def _begun(self, goal: Any) -> None:
        self._arm.goal_began(cut(goal.goal_id.id, NAME), cut(goal.goal.motion_name, NAME))

    def _ended(self, result: Any) -> None:
        succeeded = result.status.status == GoalStatus.SUCCEEDED
        self._arm.goal_ended(result.status.goal_id.id, succeeded)
