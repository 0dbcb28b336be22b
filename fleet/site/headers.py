"""Response headers for which Django has no setting."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponseBase

from fleet.accounts.requests import GetResponse
from fleet.base.web.request_ids import HEADER, request_id

# The control page uses a gamepad and keeps the screen awake. No page needs other functions of the device.
PERMISSIONS_POLICY = "gamepad=(self), screen-wake-lock=(self), camera=(), microphone=(), geolocation=()"


def request_ids(get_response: GetResponse) -> GetResponse:
    """Middleware: each answer has the id of its request, which the log of a fault has, too."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        chosen = request_id(request.headers.get(HEADER))
        request.META["fleet.request_id"] = chosen
        response = get_response(request)
        response.headers[HEADER] = chosen
        return response

    return middleware


def permissions_policy(get_response: GetResponse) -> GetResponse:
    """Middleware: limit the functions of the device that pages may use."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        response.headers.setdefault("Permissions-Policy", PERMISSIONS_POLICY)
        return response

    return middleware
