"""Help: the pages of docs/ in the console, with their pictures and links."""

from __future__ import annotations

import html
import re
from typing import Any
from urllib.parse import unquote

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import translation

from fleet.help import pages

pytestmark = pytest.mark.django_db


@pytest.fixture
def reader(client: Client, operator: object) -> Client:
    """A signed-in person."""
    client.force_login(operator)  # type: ignore[arg-type]
    return client


def test_every_page_and_all_that_it_leads_to_is_there(reader: Client) -> None:
    asked, met = set(), {}
    for name in sorted(pages.known()):
        address = pages.address_of(name)
        asked.add(address)
        body = reader.get(address)
        assert body.status_code == 200, name
        [text] = re.findall(r"<article.*?</article>", body.content.decode(), re.DOTALL)
        met |= dict.fromkeys(re.findall(r'(?:href|src)="(/[^"#]*)', text), name)
    for target in met.keys() - asked:
        assert reader.get(target).status_code == 200, (met[target], target)


def test_links_to_headings_find_them(reader: Client) -> None:
    links = 0
    for name in sorted(pages.known()):
        for page, anchor in re.findall(r'href="/help/([^"#]*)/#([^"]+)"', pages.page(name).body):
            links += 1
            target = pages.meant(page, "en")
            assert f'id="{unquote(anchor)}"' in pages.page(target or "").body, (name, page, anchor)
    assert links > 5


def test_what_is_no_page_of_help_is_not_sent(reader: Client) -> None:
    for address in (
        "/help/nothing/",
        "/help/../fleet/settings/",
        "/help/img/nothing.png",
        "/help/openapi.json/",
    ):
        assert reader.get(address).status_code == 404, address


def test_a_reader_gets_a_translated_page(reader: Client, settings: Any) -> None:
    settings.LANGUAGES = [*settings.LANGUAGES, ("es", "Español")]
    spanish = {"Accept-Language": "es-MX"}
    with translation.override(None):  # restores the language, which a page sets for its thread
        for name, language in (("student", "es"), ("gate", "en"), ("es/student", "es"), ("en/student", "en")):
            page = reader.get(f"/help/{name}/", headers=spanish).content.decode()
            assert f'help-text" lang="{language}"' in page, name
            # of a page that exists in English only
            assert ("is not translated yet" in page or "no está traducida" in page) == (name == "gate"), name
    assert 'help-text" lang="en"' in reader.get("/help/student/").content.decode()


def test_links_out_of_the_docs_become_text() -> None:
    assert "robots/shared/wire" in pages.page("protocol-messages").body
    assert "../" not in "".join(re.findall(r'href="([^"]*)"', pages.page("protocol-messages").body))


def test_help_is_for_people_who_are_signed_in(client: Client) -> None:
    answer = client.get(reverse("help-page", args=["operators"]), headers={"Accept": "text/html"})
    assert answer.status_code == 302
    assert "/accounts/sign-in/" in answer.headers["Location"]


def test_each_drawing_is_as_new_as_its_source_and_says_what_it_shows(reader: Client) -> None:
    """A drawing's name contains the hash of its source: after a change of the source, run script/drawings."""
    wanted = {file: (name, text) for name in pages.known() for file, text in pages.drawings(name).items()}
    assert wanted
    drawn = {picture for picture in pages.pictures() if picture.endswith(".svg")}
    assert drawn == set(wanted), "script/drawings was not run"
    for file, (name, source) in wanted.items():
        [said] = re.findall(r"accDescr: (.+)", source)
        body = pages.page(name).body
        assert f'src="/help/img/{file}" alt="{html.escape(said, quote=False)}"' in body
        assert "flowchart" not in body
        answer = reader.get(f"/help/img/{file}")
        assert answer.headers["Content-Type"] == "image/svg+xml"
        assert b' role="img"' in answer.content and b"<script" not in answer.content


def test_a_source_without_a_drawing_stays_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "pictures", frozenset)
    body = pages.page.__wrapped__("cameras").body
    assert "flowchart LR" in body and ".svg" not in body
