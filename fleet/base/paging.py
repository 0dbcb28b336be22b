"""Long lists of people in pages, with a search."""

from __future__ import annotations

from typing import Any

from django.core.paginator import Page, Paginator
from django.db.models import Q, QuerySet
from django.http import HttpRequest

ROWS = 100  # a class has one page


def page_of(request: HttpRequest, rows: QuerySet[Any], *searched: str) -> Page[Any]:
    """Return the page of rows that the address asks for (`page`, the words `q` in the fields `searched`).

    Its `query` holds the words. A page that does not exist is the nearest one.
    """
    query = request.GET.get("q", "").strip()[:100]
    for word in query.split():
        rows = rows.filter(Q(*((f"{field}__icontains", word) for field in searched), _connector=Q.OR))
    page = Paginator(rows, ROWS).get_page(request.GET.get("page"))
    page.query = query  # type: ignore[attr-defined]  # read by templates/site/pages.html
    return page
