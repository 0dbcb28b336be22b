"""/tts behaves like PAL's, with real actionlib messages. The holder of control uses it through the bridge."""

from __future__ import annotations

import itertools
from contextlib import contextmanager

import pytest
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from std_msgs.msg import String

from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, Topic
from robots.shared.ros.message_types.classes import message_class
from tests.processes import until
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
LONG = "una frase muy larga " * 10


@contextmanager
def bridge(master, folder, speech=TTS, allowed=()):
    """A speaking robot's bridge, a link in control, and the records so far."""
    topics = {"speech": speech, "languages": ["es-ES", "en-GB"]}
    config = tiago_config(master, folder, topics=topics, allowed=allowed)
    with running_bridge(config, master, folder) as (process, hand):
        hand.state_until(lambda state: state.phase == "online", "a robot online")
        hand.take_control(1)
        yield hand, process.recorded


@pytest.fixture(scope="class")
def talk(robot, rosmaster, tmp_path_factory):
    """A link to a robot with PAL's voice, and the records. A master has one bridge at a time."""
    with bridge(rosmaster, tmp_path_factory.mktemp("bridge")) as talk:
        yield talk


def word_of(hand, text, language="es-ES"):
    """Say `text`; return the speech state at the first word."""
    assert hand.ask(wire.Say(1, text, language, seq=next(_numbers))) is None
    return hand.state_until(
        lambda state: state.speech and state.speech.text == text and state.speech.word, f"a word of {text}"
    ).speech


def end_of(hand, number):
    """Wait for the end of the text with this number."""
    return hand.state_until(
        lambda state: state.speech_ended and state.speech_ended.number == number, f"the end of {number}"
    ).speech_ended


class TestPalsVoice:
    def test_a_text_is_said_with_word_marks_and_recorded(self, talk):
        hand, records = talk
        said = word_of(hand, "hola a todos", "es")
        assert (said.who, said.topic, said.status) == ("Ann", "/tts", "speaking")
        hand.state_until(lambda state: state.speech and state.speech.word == (7, 12), "the last word")
        assert end_of(hand, said.number).outcome == "done"
        expected = ["speech.start hola a todos es-ES /tts", "speech.end done"]
        until(lambda: records()[-2:] == expected, "both on record")

    def test_only_the_cancelled_sentence_ends(self, ros, voice, talk):
        hand, _ = talk
        said = word_of(hand, LONG)
        refused = hand.ask(wire.Say(1, "another one", "en-GB", seq=next(_numbers)))
        assert refused.figures == {"who": "Ann", "text": LONG}
        hand.send(wire.LinkCancel("speech", "Sue"))
        ended = end_of(hand, said.number)
        assert (ended.outcome, ended.text) == ("cancelled", "Cancelled by Sue.")
        with ros.listen("/tts/status", GoalStatusArray) as status:
            others = voice.say(LONG)
            status.until(lambda message: any(goal.goal_id.id == others for goal in message.status_list))
            status.settle()
            assert hand.ask(wire.SayCancel(1, seq=next(_numbers))).code == "no_speech"
            refused = hand.ask(wire.Say(1, "hello", "en-GB", seq=next(_numbers)))
            assert refused.text == "The robot speaks a text from another program: wait."
            voice.cancels.publish(GoalID(id=others))
            status.until(
                lambda message: all(goal.status != GoalStatus.ACTIVE for goal in message.status_list)
            )
            status.settle()

    def test_a_text_refused_by_the_robot_fails_in_its_words(self, talk):
        hand, records = talk
        hand.send(wire.Say(1, "saluton", "eo"))  # not a language of the robot: sent unchanged
        ended = hand.state_until(
            lambda state: state.speech_ended and state.speech_ended.outcome == "failed", "its end"
        ).speech_ended
        assert "lang_id" in ended.text
        until(lambda: records()[-1] == "speech.end failed", "its end on record")

    @pytest.mark.last  # the robot stays stopped
    def test_the_stop_silences_it(self, voice, talk):
        hand, _ = talk
        said = word_of(hand, f"alto {LONG}")
        hand.send(wire.LinkStop("Bob"))
        assert end_of(hand, said.number).outcome == "stopped"
        voice.results.until(lambda message: message.status.status == GoalStatus.PREEMPTED)


def test_a_robot_that_takes_plain_messages_gets_them(ros, rosmaster, tmp_path):
    with (
        ros.listen("/say", String) as heard,
        bridge(rosmaster, tmp_path, Topic("/say", "std_msgs/String")) as (hand, records),
    ):
        ros.connected(heard)
        hand.send(wire.Say(1, "good morning", "en-GB"))
        assert heard.next().data == "good morning"
        ended = hand.state_until(lambda state: state.speech_ended, "its end").speech_ended
        assert ended.outcome == "sent"
        until(lambda: records()[-1] == "speech.end sent", "its end on record")


def test_a_text_that_is_repeated_where_it_went_gets_there(ros, rosmaster, tmp_path):
    other = Allowed("choose", "/announce", "std_msgs/String", "speech")
    with (
        ros.listen("/announce", String) as heard,
        ros.listen("/say", String),
        bridge(rosmaster, tmp_path, Topic("/say", "std_msgs/String"), (other,)) as (hand, _),
    ):
        hand.send(wire.Say(1, "once more", "en-GB", "/announce"))
        assert heard.next().data == "once more"


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
