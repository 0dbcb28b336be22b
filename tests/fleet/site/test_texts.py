"""Pages open to everybody: the texts of scripts, and the list of cookies.

Also checks that every text of a template can be translated.
"""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from django.conf import settings
from django.template.base import Lexer, Token, TokenType
from django.test import Client
from django.utils import translation

from fleet.accounts.models import User
from fleet.base import languages
from robots.registry.models import Robot

TEMPLATES = sorted((settings.BASE_DIR / "templates").rglob("*.html"))
# Blocks that fill attributes of a tag in base.html: people do not read them.
ATTRIBUTES = {"body_class", "main_attributes"}
# The console's name, examples of input, and words equal in every language: keys, units.
SAME_EVERYWHERE = re.compile(
    r"Fleet console|\{\"linear\.x\": 0\.2\}|\b(?:ms|m/s|rad/s|Hz)\b|MCAP|rosbag2? \(\.\w+\)|/scan|/joint_states"
)
READ_OUT_OR_SHOWN = {"alt", "aria-description", "aria-label", "aria-valuetext", "placeholder", "title"}
NOT_FOR_PEOPLE = {"code", "kbd", "samp", "script", "style"}  # to type, not to read
A_DEFAULT_IN_WORDS = re.compile(r"""\|(?:default|default_if_none|yesno|pluralize):["'][^"']*[^\W\d_]""")


class Visible(HTMLParser):
    """Collects texts that a person reads or hears."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self._hidden: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in NOT_FOR_PEOPLE:
            self._hidden.append(tag)
        said = READ_OUT_OR_SHOWN | ({"value"} if dict(attrs).get("type") in {"submit", "button"} else set())
        self.texts += [value for name, value in attrs if name in said and value]

    def handle_endtag(self, tag: str) -> None:
        if self._hidden[-1:] == [tag]:
            self._hidden.pop()

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.texts.append(data)


def not_translated(source: str) -> list[str]:
    """Return the texts of a template that cannot be translated."""
    visible = Visible()
    visible.feed("".join(_left_alone(Lexer(source).tokenize())))
    visible.close()
    texts = [SAME_EVERYWHERE.sub("", text).strip() for text in visible.texts]
    return [text for text in texts if any(letter.isalpha() for letter in text)]


def _left_alone(tokens: list[Token]) -> list[str]:
    """Return the texts outside translation tags, and the default texts of variables."""
    kept, until = [], ""
    for token in tokens:
        words = token.contents.split() if token.token_type is TokenType.BLOCK else [""]
        if A_DEFAULT_IN_WORDS.search(token.contents):
            kept.append(token.contents)
        if until:
            until = "" if words[0] == until else until
        elif words[0] == "blocktranslate" or (words[0] == "block" and words[1] in ATTRIBUTES):
            until = f"end{words[0]}"
        elif token.token_type is TokenType.TEXT:
            kept.append(token.contents)
    return kept


def test_every_text_of_a_template_can_be_translated() -> None:
    found = {str(template): not_translated(template.read_text()) for template in TEMPLATES}
    assert {template: texts for template, texts in found.items() if texts} == {}


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("<p>{% translate 'Stop' %} · {{ name }}</p>", []),
        ("<p>{% blocktranslate %}Menu of {{ name }}{% endblocktranslate %}</p>", []),
        ("<p>Menu of {{ name }}</p>", ["Menu of"]),
        ("{% blocktranslate %}one{% endblocktranslate %}two", ["two"]),
        ("<a aria-label='All robots' class='back'></a>", ["All robots"]),
        ("<input type='submit' value='Import'><input type='text' value='x'>", ["Import"]),
        ("<p>{{ address|default:'Unknown' }}</p>", ["address|default:'Unknown'"]),
        ("<p>{{ address|default:_('Unknown') }}</p>", []),
        (
            "{% include 'part.html' with name=name|default:'Nobody' %}",
            ["include 'part.html' with name=name|default:'Nobody'"],
        ),
        ("<title>Robots · Fleet console</title>", ["Robots ·"]),
    ],
)
def test_a_text_that_was_forgotten_is_found(source: str, found: list[str]) -> None:
    assert not_translated(source) == found


def test_a_language_is_there_when_its_texts_are_compiled(tmp_path: Path) -> None:
    for folder, file in (("de", "django.mo"), ("pt_BR", "django.mo"), ("fr", "django.po")):
        (tmp_path / folder / "LC_MESSAGES").mkdir(parents=True)
        (tmp_path / folder / "LC_MESSAGES" / file).touch()
    found = languages.spoken("en-gb", tmp_path)
    assert found == [("en-gb", "British English"), ("de", "Deutsch"), ("pt-br", "Português Brasileiro")]


@pytest.mark.django_db
def test_a_browser_gets_its_language_or_english(settings: Any) -> None:
    german = Client(headers={"Accept-Language": "de-AT, fr;q=0.5"})
    settings.LANGUAGES = [("en-gb", "English")]
    with translation.override(None):  # restores the language, which a page sets for its thread
        assert '<html lang="en-gb"' in german.get("/cookies/").content.decode()
        settings.LANGUAGES = [*settings.LANGUAGES, ("de", "Deutsch"), ("ar", "العربية")]
        assert '<html lang="de" dir="ltr"' in german.get("/cookies/").content.decode()
        arabic = Client(headers={"Accept-Language": "ar"})
        assert '<html lang="ar" dir="rtl"' in arabic.get("/cookies/").content.decode()


@pytest.mark.django_db
def test_a_persons_choice_comes_before_the_browsers(settings: Any, operator: User) -> None:
    german = Client(headers={"Accept-Language": "de"})
    german.force_login(operator)
    settings.LANGUAGES = [("en-gb", "English"), ("de", "Deutsch"), ("es", "Español")]
    with translation.override(None):
        assert german.post("/accounts/settings/", {"language": "xx"}).status_code == 200
        page = german.post("/accounts/settings/", {"language": "es"}, follow=True).content.decode()
        assert '<html lang="es"' in page
        assert '<script src="/texts.js?language=es">' in page
    operator.refresh_from_db()
    assert languages.of_person(operator.language) == "es"


def test_the_texts_of_scripts_are_a_script_for_everybody() -> None:
    answer = Client().get("/texts.js")
    assert answer.status_code == 200
    assert answer["Content-Type"].startswith("text/javascript")
    assert b"gettext" in answer.content


@pytest.mark.django_db
def test_what_a_first_window_loads_is_compressed(operator: User, robot: Robot) -> None:
    client = Client(HTTP_ACCEPT_ENCODING="gzip")
    client.force_login(operator)
    for address in ("/texts.js?language=es", "/", f"/robots/{robot.slug}/"):
        assert client.get(address)["Content-Encoding"] == "gzip", address


@pytest.mark.django_db
def test_the_cookie_page_names_both_cookies() -> None:
    page = Client().get("/cookies/").content.decode()
    assert settings.SESSION_COOKIE_NAME in page
    assert settings.CSRF_COOKIE_NAME in page
