"""Long lists of people in pages, with a search."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from django.core.paginator import Page, Paginator
from django.db.models import Q, QuerySet
from django.http import HttpRequest, QueryDict
from django.urls import reverse

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


def list_address(request: HttpRequest, view: str, *args: object) -> str:
    """Return the address of a list, with the page and the words from which a form was sent (its field `list`)."""
    sent = QueryDict(request.POST.get("list", "")[:500])
    kept = {name: sent[name] for name in ("page", "q") if sent.get(name)}
    return reverse(view, args=args) + (f"?{urlencode(kept)}#list" if kept else "")
