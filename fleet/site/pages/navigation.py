"""The pages of the header and the menu that a person may use."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest
from django.urls import reverse
from django.utils.functional import SimpleLazyObject
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.accounts.models import User


class PageLink(Struct, frozen=True):
    """A link. `current`, as in ARIA: "page" on this very page, "true" on a page below it, else empty."""

    text: str
    url: str
    current: str


def navigation(request: HttpRequest) -> dict[str, Any]:
    """Return `site_pages` for templates. The person's rights are read only if a template shows the links.

    A request that a middleware refuses before the sign-in is read has no user.
    """
    user = getattr(request, "user", None)
    return {"site_pages": SimpleLazyObject(lambda: links_for(user, request.path))}


def links_for(user: Any, path: str) -> list[PageLink]:
    """Return the links for `user`, none for a stranger; the link of the page at `path` is the current one."""
    shown = [(text, reverse(name, args=args)) for text, name, *args in _pages_of(user)]
    around = [url for _text, url in shown if url == path or (url != "/" and path.startswith(url))]
    current = max(around, key=len, default="")
    marks = {current: "page" if current == path else "true"}
    return [PageLink(text, url, marks.get(url, "")) for text, url in shown]


def _pages_of(user: Any) -> list[tuple[str, ...]]:
    """Return text, name and arguments of each page, the most used first."""
    if not isinstance(user, User):
        return []
    courses = user.is_staff or user.supervised_courses.exists()
    supervisors = [(_("Today"), "today")] if courses or user.supervised_robots else []
    return [
        (_("Robots"), "fleet"),
        (_("Bookings"), "bookings"),
        (_("My bookings"), "bookings-mine"),
        (_("Recordings"), "recordings"),
        *supervisors,
        *([(_("Courses"), "courses")] if courses else []),
        *([(_("Status"), "status")] if supervisors else []),
        *(
            [(_("Administration"), "admin:index"), (_("Webhooks"), "webhooks"), (_("E-mail"), "mail")]
            if user.is_staff
            else []
        ),
        (_("Help"), "help-page", "operators"),
    ]
