"""/tts behaves like PAL's, with real actionlib messages. The holder of control uses it through the bridge."""

from __future__ import annotations

import itertools
from contextlib import contextmanager

import pytest
from actionlib_msgs.msg import GoalID, GoalStatus

from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from tests.ros.bridge_support import running_bridge, tiago_config

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


def test_it_speaks_and_reports_each_word(voice):
    goal_id = voice.say("hello lab")
    result = voice.result(goal_id)
    assert result.status.status == GoalStatus.SUCCEEDED
    assert result.result.text == "hello lab"
    events = [voice.feedback.next().feedback for _ in range(3)]
    assert [(event.event_type, event.text_said) for event in events] == [
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


# --- through the bridge --------------------------------------------------------------------------------

TTS = Topic("/tts", "pal_interaction_msgs/TtsAction")


@contextmanager
def bridge(master, folder, speech=TTS, allowed=()):
    """A speaking robot's bridge, a link in control, and the records so far."""
    topics = {"speech": speech, "languages": ["es-ES", "en-GB"]}
    config = tiago_config(master, folder, topics=topics, allowed=allowed)
    with running_bridge(config, master, folder) as (process, hand):
        hand.state_until(lambda state: state.phase == "online", "a robot online")
        hand.take_control(1)
        yield hand, process.recorded


def test_sound_play_says_a_text_and_the_stop_silences_it(ros, rosmaster, tmp_path):
    kind = message_class("sound_play/SoundRequest")
    with (
        ros.listen("/robotsound", kind) as heard,
        bridge(rosmaster, tmp_path, Topic("/robotsound", "sound_play/SoundRequest")) as (hand, _),
    ):
        ros.connected(heard)
        hand.send(wire.Say(1, "good morning", "en-GB"))
        request = heard.next()
        assert (request.sound, request.command, request.arg) == (kind.SAY, kind.PLAY_ONCE, "good morning")
        assert request.volume == 1.0
        hand.send(wire.LinkStop("Bob"))
        request = heard.next()
        assert (request.sound, request.command) == (kind.ALL, kind.PLAY_STOP)
