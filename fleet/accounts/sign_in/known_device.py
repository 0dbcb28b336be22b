"""A person's own device: the link of their course signs them in there, without the password.

The person chooses it when they sign in. The device keeps a signed cookie; it ends with the password, with the account,
or after `KEPT`. A second factor is asked for as ever. Staff always type their password.
"""

from __future__ import annotations

from datetime import timedelta

from django.conf import settings
from django.core import signing
from django.core.exceptions import ValidationError
from django.http import HttpRequest, HttpResponse
from django.utils.crypto import constant_time_compare, salted_hmac

from fleet.accounts.models import User

KEPT = timedelta(days=120)  # a term
_SALT = "fleet.accounts.known_device"


def cookie() -> str:
    """Return the name of the cookie."""
    return settings.SESSION_COOKIE_NAME.replace("session", "device")


def remember(response: HttpResponse, person: User) -> None:
    """Keep on this device that it is the person's own."""
    value = signing.dumps([str(person.pk), _mark(person)], salt=_SALT)
    response.set_cookie(
        cookie(),
        value,
        max_age=KEPT,
        secure=settings.SESSION_COOKIE_SECURE,
        httponly=True,
        samesite="Lax",
    )


def known_person(request: HttpRequest) -> User | None:
    """Return the person whose own device sends this request, if the account may still use it."""
    try:
        key, mark = signing.loads(request.COOKIES.get(cookie(), ""), salt=_SALT, max_age=KEPT)
        person = User.objects.filter(pk=key, is_active=True, is_staff=False).first()
    except (signing.BadSignature, ValueError, TypeError, ValidationError):
        return None
    return person if person and constant_time_compare(mark, _mark(person)) else None


def forget(response: HttpResponse) -> None:
    """Remove the mark from this device."""
    response.delete_cookie(cookie(), samesite="Lax")


def _mark(person: User) -> str:
    """Return a text that changes with the password, and does not show the hash of a session."""
    return salted_hmac(_SALT, person.get_session_auth_hash(), algorithm="sha256").hexdigest()[:32]
