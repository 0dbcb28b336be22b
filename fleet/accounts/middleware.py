"""Keeps the list of sign-ins up to date."""

from __future__ import annotations

from collections.abc import Callable

from django.http import HttpRequest, HttpResponseBase

from fleet.accounts.services import sign_in_seen as note_seen


def sign_in_seen(
    get_response: Callable[[HttpRequest], HttpResponseBase],
) -> Callable[[HttpRequest], HttpResponseBase]:
    """Middleware: after each page, note that its sign-in was used (written at most once a minute)."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        if request.user.is_authenticated:
            note_seen(request)
        return response

    return middleware
