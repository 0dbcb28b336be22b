"""Help: the pages of docs/ in the console, with their pictures and links."""

from __future__ import annotations

import re

import pytest
from django.test import Client
from django.urls import reverse

from fleet.help import pages

pytestmark = pytest.mark.django_db


@pytest.fixture
def reader(client: Client, operator: object) -> Client:
    """A signed-in person."""
    client.force_login(operator)  # type: ignore[arg-type]
    return client


def test_every_page_and_all_that_it_leads_to_is_there(reader: Client) -> None:
    for name in sorted(pages.known()):
        address = pages.address_of(name)
        body = reader.get(address)
        assert body.status_code == 200, name
        [text] = re.findall(r"<article.*?</article>", body.content.decode(), re.DOTALL)
        for target in re.findall(r'(?:href|src)="(/[^"#]*)', text):
            assert reader.get(target).status_code == 200, (name, target)


def test_links_to_headings_find_them(reader: Client) -> None:
    links = 0
    for name in sorted(pages.known()):
        for page, anchor in re.findall(r'href="/help/([^"#]*)/#([^"]+)"', pages.page(name).body):
            links += 1
            target = page if page in pages.known() else f"{page}/{pages.INDEX}"
            assert f'id="{anchor}"' in pages.page(target).body, (name, page, anchor)
    assert links > 5


def test_what_is_no_page_of_help_is_not_sent(reader: Client) -> None:
    for address in (
        "/help/nothing/",
        "/help/../fleet/settings/",
        "/help/img/nothing.png",
        "/help/openapi.json/",
    ):
        assert reader.get(address).status_code == 404, address


def test_links_out_of_the_docs_become_text() -> None:
    assert "robots/wire" in pages.page("protocol-messages").body
    assert "../" not in "".join(re.findall(r'href="([^"]*)"', pages.page("protocol-messages").body))


def test_help_is_for_people_who_are_signed_in(client: Client) -> None:
    answer = client.get(reverse("help-page", args=["operators"]), headers={"Accept": "text/html"})
    assert answer.status_code == 302
    assert "/accounts/sign-in/" in answer.headers["Location"]
