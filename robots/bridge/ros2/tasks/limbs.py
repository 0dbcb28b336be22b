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
from robots.shared.texts import SENTENCE, cut


class LimbsEnds(RobotPart):
    """The limbs of one robot."""

    @classmethod
    def of(cls, node: Node) -> Limbs | None:
        if not node.config.topics.limbs:
            return None
        participant = joined(node).participant
        return Limbs(node, lambda source, reports: _Limb(participant, source, reports))


class _Limb(ActionEnds, GoalListener):
    """control_msgs/action/FollowJointTrajectory of one limb."""

    def __init__(self, participant: Participant, source: LimbSource, reports: LimbReports) -> None:
        self._source, self._reports = source, reports
        super().__init__(participant, Topic(source.action, source.type), self)

    def move(self, goal_id: str, to_m: float, seconds: float) -> None:
        joints = self._source.joints
        way = trajectory(dict.fromkeys(joints, to_m / len(joints)), seconds)
        self.send(goal_id, self.goal_class(trajectory=way))

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._reports.running({goal_id: status == EXECUTING for goal_id, status in goals.items()})

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        said = cut(result.error_string, SENTENCE) if result else text
        self._reports.ended(goal_id, outcome, said or text, result)
