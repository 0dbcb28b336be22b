"""Middleware of every request: forms of strangers, sign-in, a person's choices, the use of a sign-in."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from django.conf import settings
from django.contrib.auth.middleware import LoginRequiredMiddleware
from django.core.exceptions import TooManyFieldsSent
from django.db import InterfaceError, OperationalError
from django.http import HttpRequest, HttpResponseBase, JsonResponse
from django.utils import timezone, translation
from django.utils.translation import gettext as _

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.requests import GetResponse, wants_json
from fleet.base import languages, zones
from fleet.base.web import origin

logger = logging.getLogger(__name__)

STRANGERS_FIELDS = 100
_BETWEEN_FIELDS = {"application/x-www-form-urlencoded": b"&", "multipart/form-data": b"form-data"}


class SignInRequired(LoginRequiredMiddleware):
    """Require a signed-in person for every page, except views that are marked with `login_not_required`."""

    def handle_no_permission(  # type: ignore[override]  # the stubs allow redirects only
        self, request: HttpRequest, view_func: Callable[..., Any]
    ) -> HttpResponseBase:
        """Redirect browsers, which accept HTML, to the sign-in page; answer scripts with an error."""
        if wants_json(request):
            text = "Not done: you are signed out. Sign in again."
            return JsonResponse({"code": "signed_out", "text": text, "rule": "account"}, status=401)
        return super().handle_no_permission(request, view_func)


class TooManyFields(TooManyFieldsSent):
    """A form has more fields than the console reads."""

    def __init__(self, most: int) -> None:
        self.text = _(
            "Not done: this form has more than %(most)d fields. Choose fewer entries at a time."
        ) % {"most": most}
        super().__init__(self.text)


def few_fields_of_strangers(get_response: GetResponse) -> GetResponse:
    """Middleware: refuse large forms of people who are not signed in, before the form is read.

    Forms of signed-in people may have as many fields as the largest list of people has lines, and more
    (`DATA_UPLOAD_MAX_NUMBER_FIELDS`). No form that a stranger sees has more than 20.
    """

    def middleware(request: HttpRequest) -> HttpResponseBase:
        between = _BETWEEN_FIELDS.get(request.content_type or "")
        if between and not request.user.is_authenticated and request.body.count(between) > STRANGERS_FIELDS:
            raise TooManyFields(STRANGERS_FIELDS)
        return get_response(request)

    return middleware


class ViewersChoices:
    """Show pages in the time zone and language that the signed-in person chose; else the lab's, the browser's."""

    def __init__(self, get_response: GetResponse) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Answer the request in the lab's zone. The zone that `process_view` sets ends with the request."""
        with timezone.override(settings.TIME_ZONE), origin.during(request):
            return self._get_response(request)

    def process_view(self, request: HttpRequest, view: Callable[..., Any], *_arguments: Any) -> None:
        """Set both. Pages that need no sign-in do not read the account."""
        if getattr(view, "login_required", True) and isinstance(request.user, User):
            timezone.activate(zones.zone_of(request.user.time_zone))
            if language := languages.chosen(request.user.language):
                translation.activate(language)


def sign_in_seen(get_response: GetResponse) -> GetResponse:
    """Middleware: after each page, note that its sign-in was used."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        if isinstance(request.user, User):
            try:
                services.sign_in_seen(request)
            except (OperationalError, InterfaceError) as error:  # a stop must not fail when the disk is full
                logger.warning("The list of sign-ins could not be brought up to date: %s", error)
        return response

    return middleware
