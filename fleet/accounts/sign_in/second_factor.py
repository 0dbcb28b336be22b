"""Second factors: an authenticator app, passkeys, and recovery codes for a person who has lost both."""

from __future__ import annotations

from typing import Any

from allauth.mfa.base.forms import AuthenticateForm, ReauthenticateForm
from allauth.mfa.models import Authenticator
from django.conf import settings
from django.core.exceptions import ValidationError
from django.http import HttpRequest, HttpResponseBase, JsonResponse
from django.shortcuts import redirect
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.accounts.requests import GetResponse, wants_json
from fleet.accounts.sign_in import throttle
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import TokenInvalid
from fleet.base.web.stop_addresses import is_stop

KINDS = (Authenticator.Type.TOTP, Authenticator.Type.WEBAUTHN)  # recovery codes alone are no second factor
# The beginnings of paths that are open to people who must have a second factor and have none yet.
# Not all of /accounts/: some pages give things, such as a token, that would later work without the factor.
_OWN = (
    "sign-in/",
    "sign-out/",
    "closed/",
    "again/",
    "second-factor/",
    "password/",
    "email/",
    "sessions/",
    "oidc/",
)
OPEN = (
    *(f"/accounts/{page}" for page in _OWN),
    *("/static/", "/texts.js", "/cookies/", "/privacy/", "/healthz", "/readyz", "/livez"),
)


def has_second_factor(user: User) -> bool:
    """Return whether the person signs in with a second factor."""
    return bool(Authenticator.objects.filter(user=user, type__in=KINDS).exists())


def is_missing(user: User) -> bool:
    """Return whether the person needs a second factor and has none.

    Staff need one if FLEET_STAFF_TWO_FACTOR is set.
    """
    return settings.FLEET_STAFF_TWO_FACTOR and user.is_staff and not has_second_factor(user)


def require_for_token(token: Token) -> None:
    """Raise `TokenInvalid` if the token's person must set up a second factor first.

    Service accounts are exempt.
    """
    if not token.user.project and is_missing(token.user):
        text = "Staff sign in with a second factor here. Set yours up on the page Your account."
        raise TokenInvalid("second_factor_missing", text)


def is_last_required(authenticator: Authenticator) -> bool:
    """Return whether its person must keep this second factor: staff with no other one."""
    if not (settings.FLEET_STAFF_TWO_FACTOR and authenticator.user.is_staff and authenticator.type in KINDS):
        return False
    others = Authenticator.objects.filter(user_id=authenticator.user_id, type__in=KINDS)
    return not others.exclude(pk=authenticator.pk).exists()


def second_factors_remove(user: User) -> int:
    """Remove a person's second factors and recovery codes, because they are lost. Return their number."""
    count: int = Authenticator.objects.filter(user=user).delete()[0]
    return count


def required(get_response: GetResponse) -> GetResponse:
    """Middleware: until staff have set up a required second factor, allow only the `OPEN` pages and stops."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        if (
            not settings.FLEET_STAFF_TWO_FACTOR
            or request.path.startswith(OPEN)
            or request.path == "/accounts/"
        ):
            return get_response(request)
        if is_stop((request.method or "").encode(), request.path.encode()):  # a stop needs no second factor
            return get_response(request)
        if not isinstance(request.user, User) or not is_missing(request.user):
            return get_response(request)
        text = _("Not done: staff sign in with a second factor here. Set yours up on the page Your account.")
        if wants_json(request):
            return JsonResponse(
                {"code": "second_factor_missing", "text": text, "rule": "account"}, status=403
            )
        return redirect("mfa_index")

    return middleware


class _CountedCode:
    """A form with a code. Wrong codes are counted for each person, not for each address."""

    user: Any

    def clean_code(self) -> str:
        """Refuse after too many wrong codes, or check the code."""
        name = throttle.second_factor_of(self.user)
        try:
            with throttle.attempt(username=name, address=name):
                return super().clean_code()  # type: ignore[misc,no-any-return]  # of the other base class
        except throttle.TooMany as error:
            raise ValidationError(throttle.words(error.wait_s), code="throttled") from error


class CodeForm(_CountedCode, AuthenticateForm):
    """The second step of a sign-in."""


class CodeAgainForm(_CountedCode, ReauthenticateForm):
    """The code again, before a change of the account."""
