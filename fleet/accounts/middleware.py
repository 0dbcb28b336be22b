"""Keeps the list of sign-ins up to date."""

from __future__ import annotations

import logging
from collections.abc import Callable

from django.db import OperationalError
from django.http import HttpRequest, HttpResponseBase

from fleet.accounts import services
from fleet.accounts.models import User

logger = logging.getLogger(__name__)


def sign_in_seen(
    get_response: Callable[[HttpRequest], HttpResponseBase],
) -> Callable[[HttpRequest], HttpResponseBase]:
    """Middleware: after each page, note that its sign-in was used."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        response = get_response(request)
        if isinstance(request.user, User):
            try:
                services.sign_in_seen(request, request.user)
            except OperationalError as error:  # a stop must not fail because a disk is full
                logger.warning("The list of sign-ins could not be brought up to date: %s", error)
        return response

    return middleware
