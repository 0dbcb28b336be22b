"""Middleware of every request: require a sign-in, and note when a person was last seen."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from django.contrib.auth.middleware import LoginRequiredMiddleware
from django.db import InterfaceError, OperationalError
from django.http import HttpRequest, HttpResponseBase, JsonResponse

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.requests import wants_json

logger = logging.getLogger(__name__)


class SignInRequired(LoginRequiredMiddleware):
    """Every page needs a signed-in person unless it says otherwise."""

    def handle_no_permission(  # type: ignore[override]  # the stubs allow redirects only
        self, request: HttpRequest, view_func: Callable[..., Any]
    ) -> HttpResponseBase:
        """Redirect browsers, which accept HTML, to the sign-in page; answer scripts with an error."""
        if wants_json(request):
            text = "Not done: you are signed out. Sign in again."
            return JsonResponse({"code": "signed_out", "text": text, "rule": "account"}, status=401)
        return super().handle_no_permission(request, view_func)


def sign_in_seen(
    get_response: Callable[[HttpRequest], HttpResponseBase],
) -> Callable[[HttpRequest], HttpResponseBase]:
    """Middleware: after each page, note that its sign-in was used."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        if isinstance(request.user, User):
            try:
                services.sign_in_seen(request)
            except (OperationalError, InterfaceError) as error:  # a stop must not fail because a disk is full
                logger.warning("The list of sign-ins could not be brought up to date: %s", error)
        return response

    return middleware
