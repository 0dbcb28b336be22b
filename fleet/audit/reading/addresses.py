"""URLs of the log's lists and their pages. Lists of other apps use them, too."""

from __future__ import annotations

import datetime
from itertools import groupby
from typing import Any, TypeVar
from urllib.parse import urlencode
from uuid import UUID

from django.core.exceptions import BadRequest
from django.http import HttpRequest
from django.urls import reverse
from django.utils.functional import Promise
from msgspec import Struct

T = TypeVar("T")


class Link(Struct, frozen=True):
    """A link on a page."""

    text: str | Promise
    url: str
    current: bool = False


def session_url_of(session_id: UUID | None) -> str:
    """Return the URL of a control session's page; blank without a control session."""
    return reverse("control-session", args=[session_id]) if session_id else ""


def by_day(
    request: HttpRequest, lines: list[tuple[datetime.date, T]]
) -> list[tuple[datetime.date, str, list[T]]]:
    """Return each day with the URL of its list, and its lines."""
    return [
        (day, f"?{address(request, since=day, until=day)}", [line for _day, line in of_day])
        for day, of_day in groupby(lines, key=lambda pair: pair[0])
    ]


def beside(
    request: HttpRequest,
    numbers: list[int],
    *,
    newer: bool,
    older: bool,
    day_before: datetime.date | None,
    day_after: datetime.date | None,
) -> dict[str, Any]:
    """Return the URLs of the neighbouring pages and days of a page with rows of these numbers."""
    links: dict[str, Any] = {}
    if newer:
        links["newest"] = f"?{address(request)}"
    if newer and numbers:
        links["newer"] = f"?{address(request, after=numbers[0])}"
    if older and numbers:
        links["older"] = f"?{address(request, before=numbers[-1])}"
    for name, day in (("day_before", day_before), ("day_after", day_after)):
        if day:
            links[name] = Link(day.isoformat(), f"?{address(request, since=day, until=day)}")
    return links


def address(request: HttpRequest, **changed: Any) -> str:
    """Return a query string: this page's filters with these changes, without the position in the list."""
    asked = request.GET.copy()
    for name in ("before", "after"):
        asked.pop(name, None)
    for name, value in changed.items():
        asked[name] = str(value)
    return urlencode([(name, value) for name, value in asked.items() if value])


def number(request: HttpRequest, name: str) -> int | None:
    """Return the record number at which a page begins, from its URL; None: it begins at the newest record."""
    asked = request.GET.get(name)
    if asked is None:
        return None
    if not (asked.isascii() and asked.isdecimal() and len(asked) <= 18):
        raise BadRequest(f"{name} is not a number of a record")
    return int(asked)
