"""The links of header and menu: the pages that a person may use, and the mark of the present one."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from django.test import Client

from fleet.accounts.models import User
from robots.access.models import Course

pytestmark = pytest.mark.django_db

EVERYBODY = ["/", "/bookings/", "/bookings/mine/", "/recordings/", "/help/operators/"]
OF_SUPERVISORS = [
    "/",
    "/bookings/",
    "/bookings/mine/",
    "/recordings/",
    "/today/",
    "/status/",
    "/help/operators/",
]
OF_TEACHERS = [
    "/",
    "/bookings/",
    "/bookings/mine/",
    "/recordings/",
    "/today/",
    "/courses/",
    "/status/",
    "/help/operators/",
]
OF_STAFF = [*OF_TEACHERS[:-1], "/admin/", "/webhooks/", "/mail/", "/help/operators/"]

SignedIn = Callable[[User], Client]


def links(client: Client, path: str) -> dict[str, str]:
    """Return addresses and marks of the header's links; check that the menu has the same."""
    [parts] = re.findall(
        r"data-pages>(.*?)</nav>.*?data-menu-pages>(.*?)</div>", client.get(path).text, re.DOTALL
    )
    found, same = (re.findall(r'<a href="([^"]+)"(?: aria-current="(\w+)")?', part) for part in parts)
    assert found == same
    return dict(found)


@pytest.mark.parametrize(
    ("person", "pages"),
    [("observer", EVERYBODY), ("operator", EVERYBODY), ("supervisor", OF_SUPERVISORS), ("staff", OF_STAFF)],
)
def test_header_has_the_pages_that_a_person_may_open(
    person: str, pages: list[str], request: pytest.FixtureRequest, signed_in: SignedIn
) -> None:
    client = signed_in(request.getfixturevalue(person))
    assert list(links(client, "/cookies/")) == pages
    for page in pages:
        assert client.get(page).status_code == 200


def test_a_supervisor_of_a_course_has_its_pages(operator: User, signed_in: SignedIn) -> None:
    course = Course.objects.create(
        name="Robots", slug="robots", starts_on="2026-10-01", ends_on="2027-02-01", role="operator"
    )
    course.supervisors.add(operator)
    assert list(links(signed_in(operator), "/cookies/")) == OF_TEACHERS


@pytest.mark.parametrize(
    ("path", "marks"),
    [
        ("/", {"/": "page"}),
        ("/bookings/new/", {"/bookings/": "true"}),
        ("/bookings/mine/", {"/bookings/mine/": "page"}),
        ("/admin/audit/record/", {"/admin/": "true"}),
        ("/accounts/", {}),
    ],
)
def test_the_present_page_is_marked(
    path: str, marks: dict[str, str], staff: User, signed_in: SignedIn
) -> None:
    assert {url: mark for url, mark in links(signed_in(staff), path).items() if mark} == marks


def test_a_stranger_sees_no_links() -> None:
    assert "data-pages" not in Client().get("/accounts/sign-in/").text


def test_the_admin_has_the_stop_of_the_other_pages(staff: User, signed_in: SignedIn) -> None:
    client = signed_in(staff)
    page = client.get("/admin/robots/robot/").text
    assert 'action="/stop-all/"' in page
    assert "js/fleet/stop_all.js" in page
    assert "data-stop-all" not in client.get("/admin/robots/robot/add/?_popup=1").text
