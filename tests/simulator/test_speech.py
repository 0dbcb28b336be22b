"""Speech takes time, word by word."""

from __future__ import annotations

import pytest

from robots.simulator.speech import Event, Utterance, objection


def test_words_are_reported_as_they_are_spoken():
    utterance = Utterance("guten Morgen", wait_s=0.0, now=10.0)
    first, *rest = utterance.marks(10.0)
    assert (first.event, first.said, first.next_word) == (Event.STARTED_WORD, "guten", "Morgen")
    assert not rest
    later = utterance.marks(60.0)
    assert [mark.event for mark in later] == [Event.STARTED_WORD, Event.FINISHED_UTTERANCE]
    assert later[-1].said == "guten Morgen"
    assert utterance.is_over(60.0)
    assert not utterance.marks(61.0)


def test_it_waits_first_when_asked_to():
    utterance = Utterance("now", wait_s=2.0, now=0.0)
    assert not utterance.marks(1.9)
    assert utterance.marks(2.0)


def test_longer_texts_take_longer():
    assert Utterance("a b c d e", 0.0, 0.0).ends_at > Utterance("a", 0.0, 0.0).ends_at > 0.1


@pytest.mark.parametrize("lang_id", ["", "en", "English", "EN_gb"])
def test_a_language_is_mandatory(lang_id):
    assert "lang_id" in objection("hello", lang_id)


def test_an_empty_text_is_refused():
    assert "empty" in objection("  ", "en_GB")


def test_a_text_with_a_language_is_fine():
    assert objection("hello", "en_GB") is None
