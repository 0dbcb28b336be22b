"""Search in spoken texts: any script, any part of a word."""

import pytest
from django.db import connection

from fleet.audit.models import Content
from fleet.audit.reading.listing import Selection, Wanted
from fleet.audit.reading.search import words_of
from fleet.audit.services import record

pytestmark = pytest.mark.django_db

SAID = {
    "arabic": "مرحبا بكم في المختبر",
    "chinese": "欢迎来到机器人实验室",
    "two characters": "你好",
    "spanish": "¡Buenos días! ¿Cómo estás, mañana?",
    "english": "Good morning, 100% of you",
    "quoted": 'She said "stop" to C:\\robot_1',
}


@pytest.fixture(params=["by the index", "text by text"])
def said(request, monkeypatch):
    """Map each record to its text's name. Tests use both search methods for any number of records."""
    if request.param == "by the index":
        monkeypatch.setattr("fleet.audit.reading.listing.FEW", 0)
    return {record("speech.start", text=text).pk: name for name, text in SAID.items()}


def found(said, asked, **wanted):
    rows = Selection(Wanted(words=words_of(asked), **wanted), ["speech.start"]).page().rows
    return {said[row.record.pk] for row in rows}


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ("المختبر", {"arabic"}),
        ("حبا", {"arabic"}),
        ("机器人", {"chinese"}),
        ("欢迎来到机器人实验室", {"chinese"}),
        ("mañana", {"spanish"}),
        ("MAÑANA", {"spanish"}),
        ("cómo", {"spanish"}),
        ("manana", set()),
        ("morning", {"english"}),
        ("GOOD", {"english"}),
        ("orni", {"english"}),
        ("nothing of the kind", set()),
    ],
)
def test_a_part_of_a_text_finds_it_in_any_script_capitals_or_not(said, asked, names):
    assert found(said, asked) == names


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ("你好", {"two characters"}),
        ("你", {"two characters"}),
        ("实", {"chinese"}),
        ("بك", {"arabic"}),
        ("DÍ", {"spanish"}),
        ("ñ", {"spanish"}),
        ("Ñ", {"spanish"}),
        ("qq", set()),
    ],
)
def test_one_or_two_characters_find_a_text_too(said, asked, names):
    assert found(said, asked) == names


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ("morning good", {"english"}),
        ('"morning good"', set()),
        ('"good morning"', {"english"}),
        ("morning of", {"english"}),
        ("morning días", set()),
        ("100%", {"english"}),
        ("1%0", set()),
        ("robot_1", {"quoted"}),
        ("robotx1", set()),
        ("C:\\", {"quoted"}),
        ("AND", set()),
        ("morning OR días", set()),
        ("morn*", set()),
        ("text:morning", set()),
        ("you -morning", set()),
        ("'; DROP TABLE audit_content; --", set()),
    ],
)
def test_all_words_have_to_be_there_and_none_is_an_operator(said, asked, names):
    assert found(said, asked) == names


def test_a_word_is_found_however_its_accents_were_typed_and_said(said):
    assert found(said, "man\u0303ana") == {"spanish"}
    decomposed = record("speech.start", text="Un cafe\u0301, por favor.")
    said[decomposed.pk] = "decomposed"
    assert found(said, "café") == {"decomposed"}


@pytest.mark.parametrize("asked", ["", "   ", '"', '""', '" "'])
def test_no_word_asks_for_everything(said, asked):
    assert words_of(asked) == ()
    assert len(found(said, asked)) == len(SAID)


def test_words_and_filters_go_together(said, operator):
    mine = record("speech.start", actor=operator, text="good evening")
    record("speech.end", of=mine, outcome="failed")
    said[mine.pk] = "mine"
    assert found(said, "good", person=str(operator.pk)) == {"mine"}
    assert found(said, "good", outcome="failed") == {"mine"}
    assert found(said, "morning", outcome="failed") == set()
    assert found(said, "good") == {"mine", "english"}


def test_a_text_that_has_expired_is_not_found(said):
    Content.objects.filter(text=SAID["english"]).delete()
    assert found(said, "morning") == set()
    assert found(said, "go") == set()


def test_names_and_figures_of_a_record_are_not_searched(said):
    record("speech.start", parameters={"language": "morning"}, private={"name": "morning"})
    assert found(said, "morning") == {"english"}


def test_the_newest_text_comes_first(said):
    texts = [record("speech.start", text=f"good {number}").pk for number in range(3)]
    rows = Selection(Wanted(words=("good",)), ["speech.start"]).page().rows
    assert [row.record.pk for row in rows][:3] == texts[::-1]


def test_each_of_many_texts_with_an_outcome_is_found_once(operator, monkeypatch):
    monkeypatch.setattr("fleet.audit.reading.listing.FEW", 0)
    wanted = {"outcome": "done", "person": str(operator.pk)}
    texts = [record("speech.start", actor=operator, text=f"good {number}") for number in range(3)]
    for text, outcome in zip(texts, ("done", "failed", "done"), strict=True):
        record("speech.end", actor=operator, of=text, outcome=outcome)
    pressed = record("stop.press", actor=operator, text="good reason")
    record("stop.press", actor=operator, of=pressed, outcome="done")
    page = Selection(Wanted(words=("good",), **wanted)).page()
    assert [row.record.pk for row in page.rows] == [pressed.pk, texts[2].pk, texts[0].pk]
    assert [row.outcome for row in page.rows] == ["done"] * 3
    assert page.count == 3


def test_a_text_too_large_for_the_index_is_found(said):
    texts = [record("speech.start", text=text).pk for text in ("good", "很好 good " * 500, "good")]
    for words in ("good", "很", "go"):
        rows = Selection(Wanted(words=words_of(words)), ["speech.start"]).page().rows
        found = [row.record.pk for row in rows if row.record.pk in texts]
        assert found == ([texts[1]] if words == "很" else texts[::-1])


@pytest.mark.skipif(connection.vendor != "sqlite", reason="what PostgreSQL does depends on its statistics")
@pytest.mark.parametrize(
    ("asked", "index"), [("morning", "VIRTUAL TABLE INDEX"), ("qq", "audit_content_said")]
)
def test_many_texts_are_searched_by_an_index_in_its_order(said, asked, index, monkeypatch):
    monkeypatch.setattr("fleet.audit.reading.listing.FEW", 0)
    [texts] = Selection(Wanted(words=words_of(asked)), ["speech.start"])._texts()
    plan = texts.order_by("-pk").values_list("pk")[:10].explain()
    assert index in plan
    assert "TEMP B-TREE" not in plan
