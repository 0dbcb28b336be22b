"""Addresses of lists of the log and their pages, which other apps' lists share."""

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
    """Somewhere to go."""

    text: str | Promise
    url: str
    current: bool = False


def session_url_of(session_id: UUID | None) -> str:
    """The page of a control session; blank if it was in none."""
    return reverse("control-session", args=[session_id]) if session_id else ""


def by_day(
    request: HttpRequest, lines: list[tuple[datetime.date, T]]
) -> list[tuple[datetime.date, str, list[T]]]:
    """Each day with the address of its list, and its lines."""
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
    """The addresses of the pages and days next to a page with rows of these numbers."""
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
    """The filters of this page, changed so, without its place among the pages."""
    asked = request.GET.copy()
    for name in ("before", "after"):
        asked.pop(name, None)
    for name, value in changed.items():
        asked[name] = str(value)
    return urlencode([(name, value) for name, value in asked.items() if value])


def number(request: HttpRequest, name: str) -> int | None:
    """Return the record number at which a page begins, from its address; None: at the newest."""
    asked = request.GET.get(name)
    if asked is None:
        return None
    if not (asked.isascii() and asked.isdecimal() and len(asked) <= 18):
        raise BadRequest(f"{name} is not a number of a record")
    return int(asked)
