"""The /tts_engine/tts action, and /say, which later software has."""

from __future__ import annotations

from typing import Any

from robots.simulator.actions.speech import Asked, SpeechServer
from robots.simulator.ros2.side import RclpySide
from robots.simulator.ros_side import Goal
from robots.simulator.speech import Event, Mark


class TtsEngineServer(SpeechServer):
    """PAL's text to speech: feedback is the word that begins."""

    def __init__(self, ros: RclpySide) -> None:
        node = ros.add_node("tts_engine")
        node.declare_parameter("non_verbal_mode", False)
        super().__init__(ros.goals("/tts_engine/tts", "tts_msgs/TTS", node))

    def _asked(self, request: Any) -> Asked:
        return Asked(request.input, request.locale, 0.0)

    def _mark(self, goal: Goal, mark: Mark) -> None:
        if mark.event is Event.STARTED_WORD:
            goal.feedback(word=mark.said.split()[-1])

    def _reason(self, why: str) -> dict[str, Any]:
        return {"error_msg": why}


class SaySkill(SpeechServer):
    """The skill that says a text in the robot's own language, without a word about its progress."""

    def __init__(self, ros: RclpySide) -> None:
        super().__init__(ros.goals("/say", "communication_skills/Say"))

    def _asked(self, request: Any) -> Asked:
        return Asked(request.input, "en_GB", 0.0)

    def _mark(self, goal: Goal, mark: Mark) -> None:
        """Say nothing."""

    def _reason(self, why: str) -> dict[str, Any]:
        return {}

    def _spoken(self, text: str) -> dict[str, Any]:
        return {}
