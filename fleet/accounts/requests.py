"""The person and the kind of answer of a request."""

from __future__ import annotations

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest

from fleet.accounts.models import User


def person_of(request: HttpRequest) -> User:
    """The signed-in person. Every page requires one unless it says otherwise."""
    if not isinstance(request.user, User):
        raise PermissionDenied("Sign in first.")
    return request.user


def wants_json(request: HttpRequest) -> bool:
    """Return whether a script asks: browsers name HTML, scripts anything else or nothing."""
    return request.get_preferred_type(["application/json", "text/html"]) == "application/json"
