"""The /tts action: one voice, so a newer goal replaces an older one."""

from __future__ import annotations

from typing import Any

import rospy

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.ros.actions.action_server import Goals
from robots.simulator.speech import Utterance, objection


class SpeechServer:
    """Speaks the texts of goals."""

    def __init__(self) -> None:
        self._result = message_class("pal_interaction_msgs/TtsResult")
        self._feedback = message_class("pal_interaction_msgs/TtsFeedback")
        self._speaking: tuple[Any, Utterance] | None = None
        self._goals = Goals("/tts", "pal_interaction_msgs/TtsAction")

    def step(self, now: float) -> None:
        """Take new goals and cancels, then continue to speak."""
        for is_goal, handle in self._goals.arrived():
            if is_goal:
                self._interrupt("a newer goal took over")
                self._begin(handle, now)
            elif self._speaking is not None and handle == self._speaking[0]:
                self._interrupt("cancelled")
        self._go_on(now)

    def _begin(self, handle: Any, now: float) -> None:
        handle.set_accepted()
        goal = handle.get_goal()
        if (why := objection(goal.rawtext.text, goal.rawtext.lang_id)) is not None:
            handle.set_aborted(self._result(msg=why), why)
            return
        self._speaking = handle, Utterance(goal.rawtext.text, goal.wait_before_speaking, now)

    def _interrupt(self, why: str) -> None:
        if self._speaking is not None:
            handle, _ = self._speaking
            self._speaking = None
            handle.set_canceled(self._result(msg=why), why)

    def _go_on(self, now: float) -> None:
        if self._speaking is None:
            return
        handle, utterance = self._speaking
        for mark in utterance.marks(now):
            feedback = self._feedback(
                event_type=int(mark.event), text_said=mark.said, next_word=mark.next_word
            )
            feedback.timestamp = rospy.Time.now()
            handle.publish_feedback(feedback)
        if utterance.is_over(now):
            self._speaking = None
            handle.set_succeeded(self._result(text=handle.get_goal().rawtext.text))
