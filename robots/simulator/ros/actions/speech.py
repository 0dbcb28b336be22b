"""The /tts action."""

from __future__ import annotations

from typing import Any

import rospy

from robots.simulator.actions.speech import Asked, SpeechServer
from robots.simulator.ros_side import Goal, RosSide
from robots.simulator.speech import Mark


class TtsServer(SpeechServer):
    """PAL's text to speech."""

    def __init__(self, ros: RosSide) -> None:
        super().__init__(ros.goals("/tts", "pal_interaction_msgs/Tts"))

    def _asked(self, request: Any) -> Asked:
        return Asked(request.rawtext.text, request.rawtext.lang_id, request.wait_before_speaking)

    def _mark(self, goal: Goal, mark: Mark) -> None:
        goal.feedback(
            event_type=int(mark.event),
            text_said=mark.said,
            next_word=mark.next_word,
            timestamp=rospy.Time.now(),
        )

    def _reason(self, why: str) -> dict[str, Any]:
        return {"msg": why}
