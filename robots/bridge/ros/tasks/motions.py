"""Goals of play_motion's action, with our own ids."""

from __future__ import annotations

from functools import partial
from typing import Any

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.motions import RecordedMotions
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.sentences import say
from robots.shared.texts import SENTENCE, cut

ERRORS = {  # PlayMotionResult's codes in words
    "MOTION_NOT_FOUND": say("the robot does not know this motion"),
    "CONTROLLER_BUSY": say("something else moves these joints"),
    "MISSING_CONTROLLER": say("the controller of these joints does not run"),
    "TRAJECTORY_ERROR": say("the controller does not take this motion"),
    "GOAL_NOT_REACHED": say("the joints did not get to where they should"),
    "PLANNER_OFFLINE": say("the robot’s motion planner does not run"),
    "NO_PLAN_FOUND": say("the robot found no way to its first posture without a collision"),
    "OTHER_ERROR": say("the robot does not say why"),
}


class MotionTopics(RobotPart):
    """The motion actions of one robot."""

    @classmethod
    def of(cls, node: Node) -> RecordedMotions | None:
        motions = node.config.topics.motions
        return RecordedMotions(node, partial(_MotionTopics, motions.type)) if motions else None


class _MotionTopics(ActionTopics, GoalListener):
    """The topics of one motion action, which reports to `motions`."""

    def __init__(self, type: str, name: str, motions: RecordedMotions) -> None:
        self._motions = motions
        codes = message_class(f"{type.removesuffix('Action')}Result")
        self._errors = {getattr(codes, name): words for name, words in ERRORS.items()}
        super().__init__(Topic(name, type), self, joined=motions.joined)

    def play(self, goal_id: str, motion: str) -> None:
        goal = self.goal_class()
        goal.goal_id.id = goal_id
        goal.goal.motion_name = motion
        self.send(goal)

    # --- on rospy's threads (actions.GoalListener) ----------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._motions.running(action, goals.keys())

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Report the end of a goal, with the robot's text and its error code in words."""
        said = cut(result.error_string, SENTENCE) or text
        self._motions.ended(goal_id, outcome, said, self._code_words(result.error_code))

    def _code_words(self, code: int) -> str:
        """Return the words of an error code; unknown codes keep their number."""
        return self._errors.get(code) or (say("error code {code}", code=code) if code else "")
