"""Goals of play_motion2's action."""

from __future__ import annotations

from typing import Any

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.motions import RecordedMotions
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.tasks.actions import ActionEnds, GoalListener, joined
from robots.shared.configuration.bridge_config import Topic
from robots.shared.texts import SENTENCE, cut


class MotionEnds(RobotPart):
    """The motion actions of one robot."""

    @classmethod
    def of(cls, node: Node) -> RecordedMotions | None:
        motions, participant = node.config.topics.motions, joined(node).participant
        if motions is None:
            return None
        kind = motions.type
        return RecordedMotions(
            node, lambda name, recorded: _Motions(participant, Topic(name, kind), recorded)
        )


class _Motions(ActionEnds, GoalListener):
    """One motion action, which reports to `motions`."""

    def __init__(self, participant: Participant, action: Topic, motions: RecordedMotions) -> None:
        self._motions = motions
        super().__init__(participant, action, self, motions.joined)

    def play(self, goal_id: str, motion: str) -> None:
        self.send(goal_id, self.goal_class(motion_name=motion, skip_planning=False))

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._motions.running(action, goals.keys())

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._motions.ended(goal_id, outcome, cut(result.error, SENTENCE) if result else text, "")
