"""The robot's voice: an action that reports progress, or a topic that takes plain texts and reports nothing."""

from __future__ import annotations

from typing import Any

from actionlib_msgs.msg import GoalStatus

from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.tasks.speech import SpeechReports, Voices
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.bridge.ros.tasks.publishing import Sender
from robots.bridge.tasks.speech import Utterance
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.texts import SENTENCE, cut
from robots.shared.wire import SpeechStatus

STATUSES: dict[int, SpeechStatus] = {GoalStatus.PENDING: "accepted", GoalStatus.RECALLING: "accepted"}


class SpeechTopics(RobotPart):
    """The voices of one robot."""

    @classmethod
    def of(cls, node: Node) -> Voices | None:
        speech = node.config.topics.speech
        if speech is None:
            return None
        reports = SpeechReports(node)
        return Voices(speech, lambda topic: _KINDS[topic.type](topic, reports))


class _ActionVoice(ActionTopics, GoalListener):
    """pal_interaction_msgs/TtsAction, or an action with the same fields."""

    def __init__(self, action: Topic, reports: SpeechReports) -> None:
        self._reports = reports
        feedback = message_class(f"{action.type.removesuffix('Action')}Feedback")
        self._word_begins = feedback.TTS_EVENT_STARTED_PLAYING_WORD
        super().__init__(action, self)

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        goal = self.goal_class()
        goal.goal_id.id = goal_id
        goal.goal.rawtext.text = utterance.text
        goal.goal.rawtext.lang_id = utterance.language.replace("-", "_")
        self.send(goal)
        return True

    # --- on rospy's threads (actions.GoalListener) ----------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        statuses = {goal_id: STATUSES.get(status, "speaking") for goal_id, status in goals.items()}
        self._reports.running(action, statuses)

    def feedback(self, goal_id: str, feedback: Any) -> None:
        if feedback.event_type & self._word_begins:
            self._reports.said(goal_id, feedback.text_said)

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._reports.ended(goal_id, outcome, cut(result.msg, SENTENCE) or text)


class _PlainVoice:
    """A topic that takes each text as one message and reports no progress."""

    def __init__(self, topic: Topic, _reports: SpeechReports) -> None:
        self._sender = Sender(topic.name, message_class(topic.type))

    def say(self, _goal_id: str, utterance: Utterance) -> bool:
        self._sender.send(self.message(utterance))
        return False

    def message(self, utterance: Utterance) -> Any:
        """Return a std_msgs/String."""
        return message_class("std_msgs/String")(data=utterance.text)

    def cancel(self, goal_id: str) -> None:
        """Do nothing: such a topic has no cancel."""

    def cancel_all(self) -> None:
        self._sender.withdraw()

    def close(self) -> None:
        self._sender.close()


class _SoundVoice(_PlainVoice):
    """sound_play/SoundRequest."""

    def message(self, utterance: Utterance) -> Any:
        kind = message_class("sound_play/SoundRequest")
        return kind(sound=kind.SAY, command=kind.PLAY_ONCE, volume=1.0, arg=utterance.text)

    def cancel_all(self) -> None:
        super().cancel_all()
        kind = message_class("sound_play/SoundRequest")
        self._sender.send(kind(sound=kind.ALL, command=kind.PLAY_STOP))


_KINDS: dict[str, type[_ActionVoice | _PlainVoice]] = {
    "pal_interaction_msgs/TtsAction": _ActionVoice,
    "std_msgs/String": _PlainVoice,
    "sound_play/SoundRequest": _SoundVoice,
}
