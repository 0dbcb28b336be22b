"""/tts behaves as PAL's, through real actionlib messages."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import itertools

import pytest
from actionlib_msgs.msg import GoalID, GoalStatus

from robots.bridge.ros.types import message_class

FEEDBACK = message_class("pal_interaction_msgs/TtsFeedback")
_numbers = itertools.count()


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


class Voice:
    """A client of the action's topics."""

    def __init__(self, goals, cancels, feedback, results) -> None:
        self.goals, self.cancels, self.feedback, self.results = goals, cancels, feedback, results

    def say(self, text: str, lang_id: str = "en_GB") -> str:
        goal = message_class("pal_interaction_msgs/TtsActionGoal")()
        goal.goal_id.id = f"test-{next(_numbers)}"
        goal.goal.rawtext.text = text
        goal.goal.rawtext.lang_id = lang_id
        self.goals.publish(goal)
        return goal.goal_id.id

    def result(self, goal_id: str):
        return self.results.until(lambda message: message.status.goal_id.id == goal_id)


@pytest.fixture
def voice(ros):
    with (
        ros.listen("/tts/feedback", message_class("pal_interaction_msgs/TtsActionFeedback")) as feedback,
        ros.listen("/tts/result", message_class("pal_interaction_msgs/TtsActionResult")) as results,
        ros.speak("/tts/goal", message_class("pal_interaction_msgs/TtsActionGoal")) as goals,
        ros.speak("/tts/cancel", GoalID) as cancels,
    ):
        ros.connected(feedback, results)
        yield Voice(goals, cancels, feedback, results)


def test_it_speaks_and_tells_each_word(voice):
    goal_id = voice.say("hello lab")
    result = voice.result(goal_id)
    assert result.status.status == GoalStatus.SUCCEEDED
    assert result.result.text == "hello lab"
    told = [message.feedback for message in voice.feedback.drain()]
    assert [(event.event_type, event.text_said) for event in told] == [
        (FEEDBACK.TTS_EVENT_STARTED_PLAYING_WORD, "hello"),
        (FEEDBACK.TTS_EVENT_STARTED_PLAYING_WORD, "hello lab"),
        (FEEDBACK.TTS_EVENT_FINISHED_PLAYING_UTTERANCE, "hello lab"),
    ]


def test_a_language_is_mandatory(voice):
    result = voice.result(voice.say("hello", lang_id=""))
    assert result.status.status == GoalStatus.ABORTED
    assert "lang_id" in result.result.msg


def test_a_cancel_stops_the_speech(voice):
    goal_id = voice.say("a very long sentence " * 20)
    voice.feedback.next()
    voice.cancels.publish(GoalID(id=goal_id))
    assert voice.result(goal_id).status.status == GoalStatus.PREEMPTED


def test_an_empty_goal_id_cancels_everybodys(voice):
    goal_id = voice.say("a very long sentence " * 20)
    voice.feedback.next()
    voice.cancels.publish(GoalID())
    assert voice.result(goal_id).status.status == GoalStatus.PREEMPTED


def test_a_newer_text_takes_over(voice):
    older = voice.say("a very long sentence " * 20)
    voice.feedback.next()
    newer = voice.say("yes")
    assert voice.result(older).status.status == GoalStatus.PREEMPTED
    assert voice.result(newer).status.status == GoalStatus.SUCCEEDED
