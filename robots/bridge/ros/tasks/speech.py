"""The robot's voice: an action that reports progress, or a topic that takes plain texts and reports nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Any

from actionlib_msgs.msg import GoalStatus

from robots.bridge.robot.interface import Node
from robots.bridge.robot.mailboxes import EVENTS_WAIT, Mailboxes
from robots.bridge.robot.parts import RobotPart
from robots.bridge.ros.tasks.actions import ActionTopics, GoalListener
from robots.bridge.ros.tasks.publishing import Sender
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.speech import SpeechOutput, SpeechTasks, Utterance
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.texts import SAID, SENTENCE, cut
from robots.shared.wire import SpeechStatus

STATUSES: dict[int, SpeechStatus] = {GoalStatus.PENDING: "accepted", GoalStatus.RECALLING: "accepted"}


class SpeechTopics(SpeechOutput, RobotPart):
    """The topics of one robot's voice: the default and chosen ones, all of one type.

    Changes of goals are reported to `tasks` through `mail`, on the event loop.
    """

    def __init__(self, default: Topic, mail: Mailboxes, tasks: SpeechTasks) -> None:
        self._type = default.type
        self._mail = mail
        self._tasks = tasks
        self._voices: dict[str, _ActionVoice | _PlainVoice] = {}
        self.attend({default.name})

    @classmethod
    def of(cls, node: Node) -> SpeechTopics | None:
        speech = node.config.topics.speech
        return cls(speech, node.mail, node.tasks.speech) if speech else None

    def attend(self, topics: Collection[str]) -> None:
        """Connect to these topics and no others. Calls the master."""
        for name in set(topics) - set(self._voices):
            self._voices[name] = _KINDS[self._type](Topic(name, self._type), self._mail, self._tasks)
        for name in set(self._voices) - set(topics):
            self._voices.pop(name).close()

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        return self._voices[utterance.topic].say(goal_id, utterance)

    def cancel_speech(self, goal_id: str, topic: str) -> None:
        if topic in self._voices:
            self._voices[topic].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [voice.cancel_all for voice in list(self._voices.values())]


class _ActionVoice(ActionTopics, GoalListener):
    """pal_interaction_msgs/TtsAction, or an action with the same fields."""

    def __init__(self, action: Topic, mail: Mailboxes, tasks: SpeechTasks) -> None:
        self._mail = mail
        self._tasks = tasks
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
        self._mail.post(
            ("speech", action),
            lambda: self._tasks.running(action, statuses, time.monotonic()),
            can_wait=True,
        )

    def feedback(self, goal_id: str, feedback: Any) -> None:
        if goal_id.startswith(OURS) and feedback.event_type & self._word_begins:
            said = cut(feedback.text_said, SAID)
            self._mail.post("said", lambda: self._tasks.said(goal_id, said, time.monotonic()), EVENTS_WAIT)

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        if goal_id.startswith(OURS):
            outcome = "done" if outcome == "succeeded" else outcome
            words = cut(result.msg, SENTENCE) or text
            self._mail.post(
                "speech ended",
                lambda: self._tasks.ended(goal_id, outcome, words, time.monotonic()),
                EVENTS_WAIT,
            )


class _PlainVoice:
    """A topic that takes each text as one message and reports no progress."""

    def __init__(self, topic: Topic, _mail: Mailboxes, _tasks: SpeechTasks) -> None:
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
