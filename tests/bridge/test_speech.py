"""What a robot is asked to say: one text at a time, on record, finished even when its holder goes."""

import pytest

from robots.bridge.speech import LONGEST_CHARACTERS, why_not_speakable


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
