"""The holder of control lets the robot speak: real messages, a simulated TIAGo."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, BridgeConfig, Topic
from tests.processes import until
from tests.ros.bridge_support import Hand, running_bridge
from tests.sides.side import Side
from tests.sides.visitor import Goal, Visitor

LONG = "una frase muy larga " * 10
STRING = "std_msgs/String"
TRIES = 3  # on a busy computer, a cancel of the stop before may come when the robot speaks again
_numbers = itertools.count(1)

Records = Callable[[], list[str]]


@contextmanager
def running(side: Side, config: BridgeConfig, folder: Path) -> Iterator[tuple[Hand, Records]]:
    """A speaking robot's bridge, a link in control, and the records so far."""
    with running_bridge(config, side, folder) as (process, hand):
        hand.state_until(lambda state: state.phase == "online", "a robot online")
        hand.take_control(1)
        yield hand, process.recorded


def speaking(side: Side, folder: Path, **changes: Any) -> BridgeConfig:
    topics = {"languages": ["es-ES", "en-GB"], **changes.pop("topics", {})}
    return side.config(folder, "speech", topics=topics, **changes)


@pytest.fixture(scope="class")
def talk(side: Side, robot: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Hand, Records]]:
    """A link to a robot with PAL's voice, and the records. A robot has one bridge at a time."""
    folder = tmp_path_factory.mktemp("bridge")
    with running(side, speaking(side, folder), folder) as talk:
        yield talk


def word_of(hand: Hand, text: str, language: str = "es-ES") -> Any:
    """Say `text` as soon as the robot says nothing of the test before; return the speech state at the first word."""
    refusals = (hand.ask(wire.Say(1, text, language, seq=number)) for number in _numbers)
    assert until(
        lambda: [one for one in [next(refusals)] if one is None or one.code != "speaking"], "silence"
    ) == [None]
    return hand.state_until(
        lambda state: state.speech and state.speech.text == text and state.speech.word, f"a word of {text}"
    ).speech


def end_of(hand: Hand, number: int) -> Any:
    """Wait for the end of the text with this number."""
    return hand.state_until(
        lambda state: state.speech_ended and state.speech_ended.number == number, f"the end of {number}"
    ).speech_ended


def last_word(hand: Hand, number: int, word: tuple[int, int]) -> bool:
    """Wait for this word of a text; return False if the text ends before it."""

    def over(state: wire.State) -> Any:
        return state.speech_ended and state.speech_ended.number == number

    found = hand.state_until(
        lambda state: (state.speech and state.speech.word == word) or over(state), "the last word"
    )
    return not over(found)


def another_programs(visitor: Visitor, side: Side, text: str) -> Goal:
    """Let the visitor say a text; return its goal when the robot speaks it."""
    speech = side.topics.speech
    assert speech is not None
    fields = (
        {"rawtext": {"text": text, "lang_id": "en_GB"}}
        if side.number == 1
        else {"input": text, "locale": "en_GB"}
    )
    goal = visitor.goal(speech.name, speech.type, **fields)
    assert goal.accepted()
    for _ in range(3):  # words: the bridge has heard of it
        goal.feedback.next()
    return goal


class TestPalsVoice:
    def test_a_text_is_said_with_word_marks_and_recorded(
        self, side: Side, talk: tuple[Hand, Records]
    ) -> None:
        hand, records = talk
        assert side.topics.speech is not None
        name = side.topics.speech.name
        for _ in range(TRIES):
            said = word_of(hand, "hola a todos", "es")
            assert (said.who, said.topic, said.status) == ("Ann", name, "speaking")
            ended = last_word(hand, said.number, (7, 12)) and end_of(hand, said.number)
            if ended and ended.outcome != "cancelled":
                break
        assert ended and ended.outcome == "done"
        expected = [f"speech.start hola a todos es-ES {name}", "speech.end done"]
        until(lambda: records()[-2:] == expected, "both on record")

    def test_only_the_cancelled_sentence_ends(
        self, side: Side, visitor: Visitor, talk: tuple[Hand, Records]
    ) -> None:
        hand, _ = talk
        said = word_of(hand, LONG)
        refused = hand.ask(wire.Say(1, "another one", "en-GB", seq=next(_numbers)))
        assert refused is not None and refused.figures == {"who": "Ann", "text": LONG}
        hand.send(wire.LinkCancel("speech", "Sue"))
        ended = end_of(hand, said.number)
        assert (ended.outcome, ended.text) == ("cancelled", "Cancelled by Sue.")
        others = another_programs(visitor, side, LONG)
        refused = hand.ask(wire.SayCancel(1, seq=next(_numbers)))
        assert refused is not None and refused.code == "no_speech"
        said_of_others = until(
            lambda: hand.ask(wire.Say(1, "hello", "en-GB", seq=next(_numbers))), "a refusal"
        )
        assert said_of_others.text == "The robot speaks a text from another program: wait."
        visitor.cancel(side.topics.speech.name)
        assert others.ended()[0] == "canceled"

    def test_a_text_refused_by_the_robot_fails_in_its_words(self, talk: tuple[Hand, Records]) -> None:
        hand, records = talk
        # Not a language of the robot: sent unchanged.
        until(lambda: hand.ask(wire.Say(1, "saluton", "eo", seq=next(_numbers))) is None, "a free voice")
        ended = hand.state_until(
            lambda state: state.speech_ended and state.speech_ended.outcome == "failed", "its end"
        ).speech_ended
        assert "lang_id" in ended.text
        until(lambda: records()[-1] == "speech.end failed", "its end on record")

    def test_the_stop_silences_it(self, talk: tuple[Hand, Records]) -> None:
        hand, _ = talk
        said = word_of(hand, f"alto {LONG}")
        stop(hand)
        assert end_of(hand, said.number).outcome == "stopped"

    def test_the_stop_silences_other_programs(
        self, side: Side, visitor: Visitor, talk: tuple[Hand, Records]
    ) -> None:
        hand, _ = talk
        others = another_programs(visitor, side, LONG)
        stop(hand)
        assert others.ended()[0] == "canceled"


def stop(hand: Hand) -> None:
    """Press the stop, and let go of it again when the robot stands."""
    hand.send(wire.LinkStop("Bob"))
    number = hand.state_until(lambda state: state.stop.state == "stopped", "standstill").stop.number
    hand.send(wire.LinkClear("Bob", number, next(_numbers)))
    hand.state_until(lambda state: state.stop.state == "clear", "a clear stop")


def says(hand: Hand, text: wire.Say) -> None:
    """Say a text, as soon as the bridge has found who listens."""
    until(lambda: hand.ask(replace(text, seq=next(_numbers))) is None, "a listener")


def test_a_robot_that_takes_plain_messages_gets_them(
    side: Side, robot: Any, visitor: Visitor, tmp_path: Path
) -> None:
    config = speaking(side, tmp_path, topics={"speech": Topic("/say", side.type(STRING))})
    with visitor.listen("/say", STRING) as heard, running(side, config, tmp_path) as (hand, records):
        visitor.connected(heard)
        says(hand, wire.Say(1, "good morning", "en-GB"))
        assert heard.next().data == "good morning"
        ended = hand.state_until(lambda state: state.speech_ended, "its end").speech_ended
        assert ended is not None and ended.outcome == "sent"
        until(lambda: records()[-1] == "speech.end sent", "its end on record")


def test_a_text_that_is_repeated_where_it_went_gets_there(
    side: Side, robot: Any, visitor: Visitor, tmp_path: Path
) -> None:
    other = Allowed("choose", "/announce", side.type(STRING), "speech")
    config = speaking(side, tmp_path, topics={"speech": Topic("/say", side.type(STRING))}, allowed=(other,))
    with (
        visitor.listen("/announce", STRING) as heard,
        visitor.listen("/say", STRING),
        running(side, config, tmp_path) as (hand, _),
    ):
        says(hand, wire.Say(1, "once more", "en-GB", "/announce"))
        assert heard.next().data == "once more"
