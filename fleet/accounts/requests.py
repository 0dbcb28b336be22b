"""The person and the kind of answer of a request, and the type of middleware."""

from __future__ import annotations

from collections.abc import Callable

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponseBase

from fleet.accounts.models import User

GetResponse = Callable[[HttpRequest], HttpResponseBase]


def person_of(request: HttpRequest) -> User:
    """Return the signed-in person. Every page requires one, except views with `login_not_required`."""
    if not isinstance(request.user, User):
        raise PermissionDenied("Sign in first.")
    return request.user


def staff_of(request: HttpRequest, why: str) -> User:
    """Return the signed-in person. Raises `PermissionDenied` with the reason `why`: the person is not staff."""
    person = person_of(request)
    if not person.is_staff:
        raise PermissionDenied(why)
    return person


def wants_json(request: HttpRequest) -> bool:
    """Return whether a script sent the request: browsers ask for HTML, scripts for JSON or no type."""
    return request.get_preferred_type(["application/json", "text/html"]) == "application/json"
