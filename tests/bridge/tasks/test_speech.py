"""Speech: one text at a time, recorded, spoken to its end even if the holder loses control."""

import msgspec
import pytest

from robots.bridge.tasks.speech import LINGER_S, Utterance, find_spoken_word, robot_language
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.configuration.spoken_texts import LONGEST_CHARACTERS, why_not_speakable
from tests.bridge.support import CONFIG, Bench, settled

SECOND = Allowed("choose", "/second_tts", "pal_interaction_msgs/TtsAction", "speech")
ALLOWING = msgspec.structs.replace(CONFIG, allowed=(SECOND,))


@pytest.mark.parametrize(
    "text", ["hola", "مرحبا بكم", "two\nlines\tand a tab", "x" * LONGEST_CHARACTERS, "a\u200cb", "👋"]
)
def test_texts_in_any_script_can_be_said(text):
    assert why_not_speakable(text) is None


@pytest.mark.parametrize("text", ["", " \n\t ", "\u200b\u00a0"])
def test_a_text_without_anything_to_hear_is_refused(text):
    assert why_not_speakable(text).code == "empty_text"


def test_a_text_that_is_too_long_is_refused_with_both_lengths():
    refusal = why_not_speakable("x" * (LONGEST_CHARACTERS + 1))
    assert refusal.code == "text_too_long"
    assert refusal.figures == {"length": 501, "limit": 500}


@pytest.mark.parametrize("character", ["\x00", "\x1b", "\x07", "\r", "\x85", "\ud800"])
def test_control_characters_are_refused_with_their_place(character):
    refusal = why_not_speakable(f"one{character}two")
    assert (refusal.code, refusal.figures) == ("control_characters", {"position": 3})


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        ("es", "es-ES"),
        ("ES", "es-ES"),
        ("es-MX", "es-ES"),
        ("en", "en-US"),
        ("EN-gb", "en-GB"),
        ("en-AU", "en-US"),
        ("zh-hant", "zh-Hant-TW"),
        ("ca", "ca"),
        ("esu", "esu"),
        ("de-AT", "de-AT"),
        ("EU-es", "EU-es"),
    ],
)
def test_language_gets_the_robots_own_tag(asked, sent):
    assert robot_language(asked, ["en-US", "en-GB", "es-ES", "zh-Hant-TW", "ca"]) == sent


def test_robot_without_languages_gets_the_requested_one():
    assert robot_language("es", []) == "es"


# --- progress of a text ---------------------------------------------------------------------------


@pytest.fixture
def bench():
    bench = Bench(config=ALLOWING).online()
    bench.granted().pass_time(0.3)
    return bench


def ask(bench, text="Hola a todos", topic=None, fence=1, language="es-ES"):
    """Send the text; return its answers so far."""
    return bench.ask(wire.Say(fence, text, language, topic))


def begun(bench, text="Hola a todos"):
    """Let the robot speak the text; return the id of the goal."""
    answers = ask(bench, text)
    settled(bench)
    assert answers == [None]
    goal_id, said = bench.base.said[-1]
    assert said.text == text
    report_status(bench, {goal_id: "speaking"})
    return goal_id


def report_status(bench, goals, topic="/tts"):
    bench.core.tasks.speech.running(topic, goals, bench.now_s)


def passes(bench, goal_id, seconds):
    """Let time pass; the robot reports the goal."""
    for _ in range(round(seconds / 0.1)):
        report_status(bench, {goal_id: "speaking"})
        bench.pass_time(0.1)


def ends(bench, goal_id, outcome="done", text=""):
    bench.core.tasks.speech.ended(goal_id, outcome, text, bench.now_s)
    bench.recorded()
    kind, end = bench.sink.records[-1]
    assert kind == "speech.end"
    return end


def shown(bench):
    return bench.core.state(bench.now_s, []).speech


def test_text_is_spoken_after_its_record_and_its_end_is_recorded(bench):
    bench.sink.open.clear()
    answers = ask(bench)
    bench.core.tick(bench.now_s)
    assert (answers, bench.base.said) == ([], [])
    bench.sink.open.set()
    settled(bench)
    assert answers == [None]
    [(goal_id, said)] = bench.base.said
    assert said == Utterance("Hola a todos", "es-ES", "/tts")
    passes(bench, goal_id, 3.0)
    end = ends(bench, goal_id)
    assert (end.outcome, end.text) == ("done", "")
    assert end.duration_s == pytest.approx(3.0, abs=0.1)
    assert bench.sink.records[0] == (
        "speech.start",
        {"text": "Hola a todos", "language": "es-ES", "topic": "/tts"},
    )
    assert bench.base.cancelled_goals == []


def test_recorded_language_is_the_one_sent(bench):
    ask(bench, language="es")
    settled(bench)
    [(_, said)] = bench.base.said
    [(_, recorded)] = bench.sink.records
    assert said.language == recorded["language"] == shown(bench).language == "es-ES"


def test_unrecorded_text_is_refused_and_not_spoken(bench):
    bench.sink.fails = "disk full"
    answers = ask(bench)
    settled(bench)
    assert [refusal.code for refusal in answers] == ["not_recorded"]
    assert bench.base.said == []
    bench.sink.fails = None
    assert begun(bench)


@pytest.mark.parametrize(
    ("spoil", "text", "code"),
    [
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "hola", "no_lease"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "hola", "stopped"),
        (lambda bench: setattr(bench.base, "listeners", 0), "hola", "robot_offline"),
        (lambda bench: report_status(bench, {"other": "speaking"}), "hola", "speaking"),
        (lambda bench: bench.core.tasks.routing.surveyed({}, bench.now_s), "hola", "no_listener"),
        (lambda bench: None, "", "empty_text"),
    ],
)
def test_unspeakable_text_is_refused_and_not_recorded(bench, spoil, text, code):
    spoil(bench)
    [refusal] = ask(bench, text)
    assert refusal.code == code
    settled(bench)
    assert bench.base.said == []
    assert "speech.start" not in bench.sink.kinds


def test_a_robot_without_a_voice_says_so():
    topics = msgspec.structs.replace(CONFIG.topics, speech=None)
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=topics)).online().granted()
    [refusal] = ask(bench)
    assert refusal.code == "not_offered"


def test_second_text_is_refused_naming_the_first(bench):
    begun(bench)
    [refusal] = ask(bench, "y otra vez")
    assert refusal.code == "speaking"
    assert refusal.figures == {"who": "Ann", "text": "Hola a todos"}
    assert refusal.text == "The robot says “\u2068Hola a todos\u2069”, requested by Ann: cancel it or wait."


def test_text_may_be_spoken_during_a_drive(bench):
    bench.driving()
    assert begun(bench)


def test_pages_see_how_far_it_is(bench):
    answers = ask(bench)
    settled(bench)
    goal_id, _ = bench.base.said[-1]
    assert answers == [None]
    assert shown(bench).status == "sent"
    report_status(bench, {goal_id: "accepted"})
    assert shown(bench).status == "accepted"
    bench.pass_time(0.5)
    report_status(bench, {goal_id: "speaking"})
    bench.core.tasks.speech.said(goal_id, "Hola a", bench.now_s)
    assert shown(bench) == wire.Speech(
        number=1, text="Hola a todos", language="es-ES", topic="/tts", who="Ann", status="speaking",
        since_s=0.5, word=(5, 6),
    )  # fmt: skip
    ends(bench, goal_id)
    state = bench.core.state(bench.now_s, [])
    assert (state.speech, state.speech_ended) == (None, wire.SpeechEnd(1, "done", ""))


def test_its_holder_cancels_it_by_its_goals_id(bench):
    assert bench.order(wire.SayCancel(1)).code == "no_speech"
    goal_id = begun(bench)
    assert bench.order(wire.SayCancel(2)).code == "unknown_fence"
    assert bench.order(wire.SayCancel(1)) is None
    assert bench.base.cancelled_goals == [goal_id]
    end = ends(bench, goal_id, "cancelled", "the robot's own words")
    assert (end.outcome, end.text) == ("cancelled", "Its holder cancelled it.")


def test_a_cancel_is_repeated_until_the_robot_obeys(bench):
    goal_id = begun(bench)
    bench.order(wire.SayCancel(1))
    passes(bench, goal_id, 1.2)
    assert bench.base.cancelled_goals == [goal_id] * 3


def test_cancel_by_a_person_without_control_names_them(bench):
    goal_id = begun(bench)
    assert bench.core.tasks.cancel("speech", "Sue Supervisor", bench.now_s) is None
    assert ends(bench, goal_id, "cancelled").text == "Cancelled by Sue Supervisor."


def test_the_stop_ends_it(bench):
    goal_id = begun(bench)
    bench.core.stop("Bob", "", bench.now_s)
    assert bench.base.cancelled_goals == [goal_id]
    assert ends(bench, goal_id, "cancelled").outcome == "stopped"


def test_a_text_whose_holder_goes_is_said_to_its_end(bench):
    goal_id = begun(bench)
    bench.core.link_lost(1, bench.now_s)
    passes(bench, goal_id, 3.0)
    bench.core.revoke(1, "over", bench.now_s)
    passes(bench, goal_id, 1.0)
    assert bench.base.cancelled_goals == []
    assert ends(bench, goal_id).outcome == "done"


@pytest.mark.parametrize(
    "spoil",
    [
        lambda bench: bench.order(wire.SayCancel(1)),
        lambda bench: setattr(bench.base, "listeners", 0),
    ],
)
def test_event_before_the_record_prevents_speech(bench, spoil):
    bench.sink.open.clear()
    ask(bench)
    spoil(bench)
    bench.sink.open.set()
    settled(bench)
    bench.recorded()
    assert bench.base.said == []
    assert bench.sink.kinds == ["speech.start", "speech.end"]


@pytest.mark.parametrize(("reported", "given_up_s"), [(True, 2.0), (False, 5.0)])
def test_a_text_that_the_robot_does_not_report_is_given_up(bench, reported, given_up_s):
    ask(bench)
    settled(bench)
    [(goal_id, _)] = bench.base.said
    if reported:
        report_status(bench, {goal_id: "speaking"})
    bench.pass_time(given_up_s - 0.2)
    assert shown(bench) is not None
    bench.pass_time(0.4)
    bench.recorded()
    assert bench.base.cancelled_goals == [goal_id]
    assert bench.sink.records[-1][1].outcome == "unheard"
    assert shown(bench) is None


def test_plain_topic_accepts_the_next_text_at_once(bench):
    bench.base.tells = False
    answers = ask(bench)
    settled(bench)
    bench.recorded()
    assert answers == [None]
    assert bench.sink.records[-1][1].outcome == "sent"
    assert ask(bench, "y otra vez") == []


def test_bridge_end_lets_the_robot_speak_and_is_recorded(bench):
    begun(bench)
    bench.core.close(bench.now_s)
    bench.recorded()
    assert bench.base.cancelled_goals == []
    assert bench.sink.records[-1][1].outcome == "unheard"


def test_late_report_of_an_ended_text_is_ignored(bench):
    goal_id = begun(bench)
    ends(bench, goal_id)
    report_status(bench, {goal_id: "speaking"})
    assert begun(bench, "y otra vez")


def test_the_end_of_another_goal_ends_nothing_here(bench):
    goal_id = begun(bench)
    bench.core.tasks.speech.ended("another", "failed", "", bench.now_s)
    assert shown(bench).text == "Hola a todos"
    assert ends(bench, goal_id).outcome == "done"


def test_a_text_may_go_to_the_topic_that_an_earlier_one_went_to(bench):
    [refusal] = ask(bench, topic="/other_tts")
    assert refusal.code == "not_allowed"
    answers = ask(bench, topic="/second_tts")
    settled(bench)
    assert answers == [None]
    assert bench.base.said == []  # still connecting
    bench.core.tick(bench.now_s)
    assert bench.base.attended == [("speech", {"/tts", "/second_tts"})]
    bench.core.tasks.routing.attended("speech", {"/tts", "/second_tts"}, bench.now_s)
    bench.core.tick(bench.now_s)
    [(goal_id, said)] = bench.base.said
    assert said.topic == "/second_tts"
    ends(bench, goal_id)
    bench.core.tick(bench.now_s)
    assert bench.base.attended[-1] == ("speech", {"/tts"})
    assert bench.core.state(bench.now_s, []).chosen == {}


def test_plain_topic_stays_connected_shortly_after_its_text(bench):
    bench.base.tells = False
    ask(bench, topic="/second_tts")
    settled(bench)
    bench.core.tick(bench.now_s)
    bench.core.tasks.routing.attended("speech", {"/tts", "/second_tts"}, bench.now_s)
    bench.core.tick(bench.now_s)
    assert len(bench.base.said) == 1
    assert bench.core.state(bench.now_s, []).speech_ended.outcome == "sent"
    bench.pass_time(LINGER_S - 0.1)  # a subscriber may have joined just before
    assert bench.base.attended == [("speech", {"/tts", "/second_tts"})]
    bench.pass_time(0.2)
    assert bench.base.attended[-1] == ("speech", {"/tts"})


def test_a_text_whose_topic_cannot_be_connected_is_given_up(bench):
    ask(bench, topic="/second_tts")
    settled(bench)
    bench.pass_time(2.2)
    bench.recorded()
    assert bench.base.said == []
    assert bench.sink.records[-1][1].outcome == "unheard"


@pytest.mark.parametrize(
    ("text", "said", "after", "word"),
    [
        ("hello lab", "hello", 0, (0, 5)),
        ("hello  lab", "hello lab", 0, (7, 10)),
        ("no no no", "no no", 2, (3, 5)),
        ("no no no", "no", 2, (3, 5)),  # robots that report only the newest word
        ("one, two", "two", 4, (5, 8)),
        ("hello lab", "", 0, None),
        ("hello lab", "elsewhere", 0, None),
        ("Ho a to", "ho a", 0, (3, 4)),  # robots with their own spelling
    ],
)
def test_the_word_that_is_spoken_is_found_in_the_text(text, said, after, word):
    assert find_spoken_word(text, said, after) == word
