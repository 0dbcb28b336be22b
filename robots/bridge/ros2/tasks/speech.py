"""The robot's voice: an action that reports the word that it says, or a topic that takes plain texts."""

from __future__ import annotations

from typing import Any

from std_msgs.msg import String

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.speech import SpeechReports, Voices
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import EVENTS
from robots.bridge.ros2.tasks.actions import ACCEPTED, ActionEnds, GoalListener, joined
from robots.bridge.tasks.speech import Utterance
from robots.shared.configuration.bridge_config import Topic
from robots.shared.texts import SENTENCE, cut
from robots.shared.wire import SpeechStatus


class SpeechEnds(RobotPart):
    """The voices of one robot."""

    @classmethod
    def of(cls, node: Node) -> Voices | None:
        speech, participant = node.config.topics.speech, joined(node).participant
        if speech is None:
            return None
        reports = SpeechReports(node)
        return Voices(speech, lambda topic: _KINDS[topic.type](participant, topic, reports))


class _TtsVoice(ActionEnds, GoalListener):
    """tts_msgs/action/TTS."""

    def __init__(self, participant: Participant, action: Topic, reports: SpeechReports) -> None:
        self._reports = reports
        super().__init__(participant, action, self)

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        self.send(goal_id, self.goal(utterance))
        return True

    def goal(self, utterance: Utterance) -> Any:
        """Return the goal that says this."""
        return self.goal_class(input=utterance.text, locale=utterance.language.replace("-", "_"))

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        statuses: dict[str, SpeechStatus] = {
            goal_id: "accepted" if status == ACCEPTED else "speaking" for goal_id, status in goals.items()
        }
        self._reports.running(action, statuses)

    def feedback(self, goal_id: str, feedback: Any) -> None:
        if word := getattr(feedback, "word", ""):
            self._reports.said(goal_id, word)

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        said = getattr(result, "error_msg", "")
        self._reports.ended(goal_id, outcome, cut(said, SENTENCE) or text)


class _SayVoice(_TtsVoice):
    """communication_skills/action/Say, a skill that knows no language and reports no word."""

    def goal(self, utterance: Utterance) -> Any:
        return self.goal_class(input=utterance.text)


class _PlainVoice:
    """A topic that takes each text as one std_msgs/msg/String and reports no progress."""

    def __init__(self, participant: Participant, topic: Topic, _reports: SpeechReports) -> None:
        self._node = participant.node
        self._publisher = self._node.create_publisher(String, topic.name, EVENTS)

    def say(self, _goal_id: str, utterance: Utterance) -> bool:
        self._publisher.publish(String(data=utterance.text))
        return False

    def cancel(self, goal_id: str) -> None:
        """Do nothing: such a topic has no cancel."""

    def cancel_all(self) -> None:
        """Do nothing: such a topic has no cancel."""

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)


_KINDS: dict[str, type[_TtsVoice | _PlainVoice]] = {
    "tts_msgs/action/TTS": _TtsVoice,
    "communication_skills/action/Say": _SayVoice,
    "std_msgs/msg/String": _PlainVoice,
}
