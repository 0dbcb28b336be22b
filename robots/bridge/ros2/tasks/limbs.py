"""Goals of gripper and torso, and the reports of their controllers."""

from __future__ import annotations

from typing import Any

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.limbs import LimbReports, Limbs
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.tasks.actions import EXECUTING, ActionEnds, GoalListener, joined
from robots.bridge.ros2.tasks.trajectories import trajectory
from robots.shared.configuration.bridge_config import LimbSource, Topic


class LimbsEnds(RobotPart):
    """The limbs of one robot."""

    @classmethod
    def of(cls, node: Node) -> Limbs | None:
        if not node.config.topics.limbs:
            return None
        participant = joined(node).participant
        return Limbs(node, lambda source, reports: _Limb(participant, source, reports))


class _Limb(ActionEnds, GoalListener):
    """The action of one limb: control_msgs/action/FollowJointTrajectory, or GripperCommand."""

    def __init__(self, participant: Participant, source: LimbSource, reports: LimbReports) -> None:
        self._source, self._reports = source, reports
        super().__init__(participant, Topic(source.action, source.type), self)

    def move(self, goal_id: str, to_m: float, seconds: float) -> None:
        goal = self.goal_class()
        if self._source.is_command:
            goal.command.position, goal.command.max_effort = float(to_m), self._source.effort_n or 0.0
        else:
            joints = self._source.joints
            goal.trajectory = trajectory(dict.fromkeys(joints, to_m / len(joints)), seconds)
        self.send(goal_id, goal)

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._reports.running({goal_id: status == EXECUTING for goal_id, status in goals.items()})

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._reports.ended(goal_id, outcome, text, result)
