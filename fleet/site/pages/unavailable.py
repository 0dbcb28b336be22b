"""Answer with 503 if the database is locked, full or does not answer: a page for people, JSON for scripts.

Also with 429 if a person makes too many changes, and with 503 if too many people sign in.
"""

from __future__ import annotations

import logging
import sys

from django.db import InterfaceError, OperationalError
from django.http import HttpRequest, HttpResponse, HttpResponseBase, JsonResponse
from django.shortcuts import render
from django.views.defaults import server_error
from msgspec import to_builtins

from fleet.accounts.requests import GetResponse, wants_json
from fleet.audit.errors import AuditUnavailable, TooManyChanges, cause_of
from robots.shared.sentences import say
from robots.shared.wire import Refusal

logger = logging.getLogger(__name__)

RETRY_AFTER_S = 5
TOO_MANY_SIGN_INS = "fleet.too_many_sign_ins"  # set in a request by the queue of sign-ins
_TOO_MANY = Refusal("busy", say("Many people sign in at this moment. Try again in a moment."), "limits")


class UnavailableInWords:
    """Middleware: answer requests that fail because of the database."""

    def __init__(self, get_response: GetResponse) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Refuse what the queue of sign-ins refused; `process_exception` handles errors of others."""
        if TOO_MANY_SIGN_INS in request.META:
            return _response(request, _TOO_MANY, 503, RETRY_AFTER_S)
        return self._get_response(request)

    def process_exception(self, request: HttpRequest, error: Exception) -> HttpResponse | None:
        """Return a 503 with the reason; None for every other error."""
        return answer(request, error)


def error_page(request: HttpRequest) -> HttpResponse:
    """Handle errors outside of the views, such as while loading a session.

    Django calls it for uncaught errors.
    """
    return answer(request, sys.exc_info()[1]) or server_error(request)


def answer(request: HttpRequest, error: BaseException | None) -> HttpResponse | None:
    """Return the response for an error of the database or the audit log; None for other errors."""
    match error:
        case TooManyChanges():
            refusal = Refusal(error.code, error.text, error.rule, error.figures)
            return _response(request, refusal, 429, error.wait_s)
        case AuditUnavailable():
            refusal = Refusal(error.code, error.text, error.rule)
        case OperationalError() | InterfaceError():
            code, cause = cause_of(error)
            refusal = Refusal(f"database_{code}", say("Not done: {cause}.", cause=cause), "database")
        case _:
            return None
    logger.error("%s %s: %s", request.method, request.path, error)
    return _response(request, refusal, 503, RETRY_AFTER_S)


def _response(request: HttpRequest, refusal: Refusal, status: int, retry_after_s: int) -> HttpResponse:
    if wants_json(request):
        response: HttpResponse = JsonResponse(to_builtins(refusal), status=status)
    else:
        response = render(request, "503.html", {"refusal": refusal}, status=status)
    response.headers["Retry-After"] = str(retry_after_s)
    return response
