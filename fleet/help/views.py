"""Views of help: a page of docs/, and a picture."""

from __future__ import annotations

from django.contrib.auth.decorators import login_not_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import get_language
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_safe

from fleet.help import pages

ERRORS = "errors"  # the page with a section for each code


@require_safe
def show(request: HttpRequest, name: str = "") -> HttpResponse:
    """Show a page of help, in the reader's language if it is translated; without a name, the list of all pages."""
    language = get_language() or ""
    found = pages.meant(name, language)
    if found is None:
        raise Http404
    page = pages.page(found)
    is_wanted = language.startswith("en") or name.startswith(pages.ENGLISH)
    untranslated = page.language == "en" and not is_wanted
    return render(request, "site/help.html", {"page": page, "untranslated": untranslated})


@login_not_required
@require_safe
def error(request: HttpRequest, error: str) -> HttpResponse:
    """Show the page of an error code, to anybody: its address is in the refusals that programs get."""
    found = pages.sections(ERRORS).get(error)
    if found is None:
        raise Http404
    page = pages.Page(error, found, "en")
    return render(request, "site/help.html", {"page": page, "untranslated": get_language() != "en"})


@require_safe
@cache_control(private=True, max_age=3600)
def picture(_request: HttpRequest, name: str) -> HttpResponse:
    """Send a picture of the pages."""
    if name not in pages.pictures():
        raise Http404
    file = pages.DOCS / "img" / name
    return HttpResponse(file.read_bytes(), content_type=pages.PICTURES[file.suffix])
