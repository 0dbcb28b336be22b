"""Sentences about robots: their English text, their key and figures on the wire, and their translations."""

from __future__ import annotations

import ast
import re
from datetime import UTC, date, datetime
from functools import cache
from itertools import pairwise
from pathlib import Path
from zoneinfo import ZoneInfo

import msgspec
import numpy as np
import pytest
from django.utils import timezone, translation

from fleet.base.formats.sentences import _catalogue, in_words, words_of
from robots.shared import wire
from robots.shared.sentences import counted, pieces, say
from script.generate import sentences

CATALOGUES = sorted(sentences.LOCALE.glob("*/LC_MESSAGES/sentences.po"))
ENTRY = re.compile(r'^(msg\w+)(?:\[\d\])? ((?:".*"\n)+)', re.MULTILINE)
GETTEXT = {"_", "gettext", "gettext_lazy", "gettext_noop", "ngettext", "ngettext_lazy"}
TRANSLATED = re.compile(r"""(?:{% translate |\b_\()(["'])(.*?)\1""")
IN_SCRIPT = re.compile(r"""gettext\(\s*("(?:[^"\\]|\\.)*")""")
SPANISH = """
msgid ""
msgstr "Content-Type: text/plain; charset=UTF-8\\nPlural-Forms: nplurals=2; plural=(n != 1);\\n"
msgid "{sensor} is {age:age} old, {gap:fine} m"
msgstr "{gap:fine} m, {sensor}: hace {age:age}"
msgid "laser"
msgstr "láser"
msgid "{count} robot until {until:clock}"
msgid_plural "{count} robots until {until:clock}"
msgstr[0] "{count} robot hasta las {until:clock}"
msgstr[1] "{count} robots hasta las {until:clock}"
"""


def test_a_sentence_is_an_english_text_with_key_and_figures() -> None:
    old = say("{sensor} is {age:age} old, {gap:fine} m", sensor=say("laser"), age=0.61239, gap=0.05)
    assert old == "laser is 0.6 s old, 0.05 m"
    refusal = wire.Refusal("late", old, "gate")
    assert type(refusal.text) is str
    figures = {"sensor": ["laser"], "age": 0.6124, "gap": 0.05}
    assert refusal.said == {"text": ["{sensor} is {age:age} old, {gap:fine} m", figures]}
    assert msgspec.json.encode(wire.Refusal("x", say("Stop."), "gate")) == (
        b'{"code":"x","text":"Stop.","rule":"gate"}'
    )


def test_a_number_of_numpy_can_be_sent() -> None:
    sent = msgspec.json.decode(
        wire.encode(wire.Refusal("x", say("{gap:fine} m", gap=np.float64(0.5)), "gate"))
    )
    assert sent["said"] == {"text": ["{gap:fine} m", {"gap": 0.5}]}


def test_sentences_are_said_in_the_readers_language(tmp_path: Path, settings, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path / "es" / "LC_MESSAGES"
    folder.mkdir(parents=True)
    (folder / "sentences.po").write_text(SPANISH)
    sentences.compiled(folder / "sentences.po")
    settings.LOCALE_PATHS = [tmp_path]
    monkeypatch.setattr("fleet.base.formats.sentences._catalogue", _catalogue.__wrapped__)
    until = datetime(2026, 12, 3, 15, tzinfo=ZoneInfo("Europe/Madrid"))
    old = say("{sensor} is {age:age} old, {gap:fine} m", sensor=say("laser"), age=0.61, gap=0.05)
    robots = counted(
        "{count} robot until {until:clock}", "{count} robots until {until:clock}", count=2, until=until
    )
    assert robots == "2 robots until 15:00"
    twice = datetime(2027, 10, 31, 1, 30, tzinfo=UTC).astimezone(until.tzinfo)
    assert say("{at:clock}, {at:when}", at=twice).endswith("2027, 02:30 (UTC+1)")
    assert say("{at:clock}", at=twice.replace(fold=0)) == "02:30 (UTC+2)"
    with translation.override("es"), timezone.override("Europe/Madrid"):
        assert in_words(old) == "0,05 m, láser: hace 0,6 s"
        assert in_words(say("{gap:.2f} m, {age:age}, {angle:.0f}°", gap=0.699, age=0.58, angle=89.6)) == (
            "0,70 m, 0,6 s, 90°"
        )
        assert in_words("") == ""
        assert words_of(wire.Refusal("x", robots, "gate")) == "2 robots hasta las 15:00"
        assert in_words(say("{at:when}", at=twice)).endswith("2027, 02:30 (UTC+1)")
    assert say("{day:day}", day=date(2026, 12, 3)) == "03 Dec 2026"


@pytest.mark.parametrize("catalogue", CATALOGUES, ids=lambda path: path.parent.parent.name)
def test_a_catalogue_has_the_keys_of_the_source_with_their_figures(catalogue: Path) -> None:
    kept = translations(catalogue)
    assert sorted(kept) == sorted(sentences.keys()), "run script/sentences"
    others = [text for key, texts in kept.items() for text in texts if figures(text) != figures(key)]
    assert others == []


@pytest.mark.parametrize(
    "catalogue", sorted(sentences.LOCALE.glob("*/*/*.po")), ids=lambda path: str(path)[-30:]
)
def test_every_text_of_a_catalogue_is_translated(catalogue: Path) -> None:
    assert [key for key, texts in translations(catalogue).items() if not all(texts)] == []
    assert "#, fuzzy" not in catalogue.read_text()


@pytest.mark.parametrize("language", sorted(sentences.LOCALE.iterdir()), ids=lambda path: path.name)
def test_every_text_of_pages_and_scripts_is_in_the_catalogue(language: Path) -> None:
    folder = language / "LC_MESSAGES"
    assert of_pages() - set(translations(folder / "django.po")) == set()
    assert of_scripts() - set(translations(folder / "djangojs.po")) == set()


@cache
def of_pages() -> set[str]:
    """Return the texts of Python and of templates, without blocks."""
    found = {
        str(call.args[0].value)
        for _, source in sentences.modules()
        if "gettext" in source
        for call in ast.walk(ast.parse(source))
        if isinstance(call, ast.Call) and call.args and isinstance(call.args[0], ast.Constant)
        if (call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")) in GETTEXT
    }
    pages = (file.read_text() for file in (sentences.ROOT / "templates").rglob("*.*"))
    return found | {text for page in pages for _, text in TRANSLATED.findall(page)}


@cache
def of_scripts() -> set[str]:
    """Return the texts of scripts."""
    scripts = (file.read_text() for file in (sentences.ROOT / "static" / "js").rglob("*.js"))
    return {ast.literal_eval(text) for script in scripts for text in IN_SCRIPT.findall(script)}


def figures(key: str) -> set[tuple[str, str]]:
    """Return names and formats of the figures in a key; not the count, which one form of a plural may leave out."""
    return {(name, form) for _, name, form in pieces(key) if name and name != "count"}


def translations(catalogue: Path) -> dict[str, list[str]]:
    """Return the translations of a catalogue by key."""
    entries = ENTRY.findall(catalogue.read_text())
    texts = [(kind, ast.literal_eval(f"({text})")) for kind, text in entries]
    keys = [number for number, (kind, _) in enumerate(texts) if kind == "msgid"]
    parts = [texts[start:end] for start, end in pairwise([*keys, len(texts)])]
    return {key[1]: [text for kind, text in rest if kind.startswith("msgstr")] for key, *rest in parts[1:]}


def test_every_sentence_can_be_in_the_catalogue() -> None:
    found = [
        place for place, source in sentences.modules() if not all(map(is_written_out, sentences.told(source)))
    ]
    assert found == []


def is_written_out(sentence: sentences.Told) -> bool:
    """Return whether a text is no f-string or sum of texts. Figures of a sentence may be any text."""
    parts = [sentence.text]
    while parts:
        match parts.pop():
            case ast.JoinedStr() | ast.BinOp():
                return False
            case ast.IfExp(body=body, orelse=otherwise):
                parts += [body, otherwise]
    return True
