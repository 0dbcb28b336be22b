"""Sign-in at the API: by token, or by a browser's session with the protection against forged requests."""

from __future__ import annotations

from django.conf import settings
from rest_framework.authentication import BaseAuthentication, SessionAuthentication
from rest_framework.exceptions import AuthenticationFailed
from rest_framework.request import Request

from fleet.accounts.models import User
from fleet.accounts.services import address_of
from fleet.accounts.sign_in.second_factor import require_for_token
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import TokenInvalid, token_of

SCHEME = "bearer"


class TokenAuthentication(BaseAuthentication):
    """`Authorization: Bearer TOKEN`.

    If the request also has a session cookie, its CSRF token is checked, too.
    """

    def authenticate(self, request: Request) -> tuple[User, Token] | None:
        """Return person and token; None: the request has no token."""
        scheme, _, text = request.headers.get("Authorization", "").partition(" ")
        if scheme.lower() != SCHEME:
            return None
        if settings.SESSION_COOKIE_NAME in request.COOKIES:
            SessionAuthentication().enforce_csrf(request)
        try:
            token = token_of(text.strip(), address_of(request._request))
            require_for_token(token)
        except TokenInvalid as error:
            raise AuthenticationFailed(error.text, error.code) from error
        return token.user, token

    def authenticate_header(self, _request: Request) -> str:
        """Answer 401, not 403, to people who are not signed in."""
        return 'Bearer realm="fleet"'
