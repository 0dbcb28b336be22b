"""Response headers for which Django has no setting."""

from __future__ import annotations

import re
from uuid import uuid4

from django.http import HttpRequest, HttpResponseBase

from fleet.accounts.requests import GetResponse

# The control page uses a gamepad and keeps the screen awake. No page needs other functions of the device.
PERMISSIONS_POLICY = "gamepad=(self), screen-wake-lock=(self), camera=(), microphone=(), geolocation=()"


REQUEST_ID = "X-Request-ID"


def request_id(given: str | None) -> str:
    """Return the id that a client chose for its request, if it is one, else a new one."""
    return given if given and re.fullmatch("[A-Za-z0-9._-]{1,64}", given) else uuid4().hex


def request_ids(get_response: GetResponse) -> GetResponse:
    """Middleware: each answer of the API has the id of its request, which the log of a fault has, too."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        if not request.path.startswith("/api/"):
            return get_response(request)
        chosen = request_id(request.headers.get(REQUEST_ID))
        request.META["fleet.request_id"] = chosen
        response = get_response(request)
        response.headers[REQUEST_ID] = chosen
        return response

    return middleware


def permissions_policy(get_response: GetResponse) -> GetResponse:
    """Middleware: limit the functions of the device that pages may use."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        response.headers.setdefault("Permissions-Policy", PERMISSIONS_POLICY)
        return response

    return middleware
