"""Goals of gripper and torso, and the reports of their controllers."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.bridge.limbs.limb_move import LimbMove, LimbMover
from robots.bridge.robot.interface import Node
from robots.bridge.robot.mailboxes import EVENTS_WAIT, Mailboxes
from robots.bridge.robot.parts import RobotPart
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.shared.configuration.bridge_config import GRIPPER_COMMAND, LimbSource, Topic
from robots.shared.texts import SENTENCE, cut
from robots.shared.wire import Limb


class LimbsTopics(LimbMover, RobotPart):
    def __init__(self, node: Node) -> None:
        self._node = node
        self._limbs = {
            limb: LimbTopics(source, node.mail, node.tasks.limbs.move(limb))
            for limb, source in node.config.topics.limbs.items()
        }

    @classmethod
    def of(cls, node: Node) -> LimbsTopics | None:
        return cls(node) if node.config.topics.limbs else None

    def limb_at(self, limb: Limb) -> float | None:
        places = [self._node.joint(name) for name in self._node.config.topics.limbs[limb].joints]
        known = [place for place in places if place is not None]
        return sum(known) if len(known) == len(places) else None

    def limb_has_listener(self, limb: Limb) -> bool:
        return self._limbs[limb].action.heard

    def move_limb(self, limb: Limb, goal_id: str, to_m: float, seconds: float) -> None:
        self._limbs[limb].move(goal_id, to_m, seconds)

    def cancel_limb(self, limb: Limb, goal_id: str) -> None:
        self._limbs[limb].action.cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [limb.action.cancel_all for limb in self._limbs.values()]


class LimbTopics(GoalListener):
    """The action of one limb. Its reports go to `move` through `mail`, on the event loop."""

    def __init__(self, source: LimbSource, mail: Mailboxes, move: LimbMove) -> None:
        self._source = source
        self._mail = mail
        self._move = move
        self.action = ActionTopics(Topic(source.action, source.type), self)

    def move(self, goal_id: str, to_m: float, seconds: float) -> None:
        """Send a goal: all joints move equally. The goal of a gripper's own controller has no duration."""
        message = self.action.goal_class()
        message.goal_id.id = goal_id
        message.header.stamp = message.goal_id.stamp = rospy.Time.from_sec(time.time())
        if self._source.type == GRIPPER_COMMAND:
            command = message.goal.command
            command.position, command.max_effort = to_m, self._source.effort_n or 0.0
        else:
            message.goal.trajectory = self._trajectory(to_m, seconds)
        self.action.send(message)

    def _trajectory(self, to_m: float, seconds: float) -> JointTrajectory:
        joints = self._source.joints
        point = JointTrajectoryPoint(
            positions=[to_m / len(joints)] * len(joints), time_from_start=rospy.Duration.from_sec(seconds)
        )
        # The stamp is zero: the trajectory begins when it arrives. The base's own clock may be ahead.
        return JointTrajectory(joint_names=joints, points=[point])

    # --- on rospy's threads ---------------------------------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        active = {goal_id: status == GoalStatus.ACTIVE for goal_id, status in goals.items()}
        self._mail.post(
            (action, "goals"), lambda: self._move.running(active, time.monotonic()), can_wait=True
        )

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Report the end of a goal, with the controller's text. A gripper may have stalled, also if it succeeded."""
        if self._source.type == GRIPPER_COMMAND:
            said = text
            if outcome in {"succeeded", "failed"} and result.stalled and not result.reached_goal:
                outcome = "stalled"
        else:
            said = text or cut(result.error_string, SENTENCE)
        self._mail.post(
            (self._source.action, "ended"),
            lambda: self._move.ended(goal_id, outcome, said, time.monotonic()),
            EVENTS_WAIT,
        )
