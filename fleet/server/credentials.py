"""Find a request's credential: a session's cookie, or a program's token. It is a hint until it is looked up.

All functions are pure.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from twisted.web.http_headers import Headers

_BEARER = re.compile(rb"bearer +(\S+) *", re.IGNORECASE)
_BEARER_LINE = re.compile(rb"\r\nauthorization: *bearer +([^\s]+)", re.IGNORECASE)


class Credential(NamedTuple):
    """The key of a session, or the text of a token. Nobody has checked it yet."""

    text: str
    is_token: bool = False


def credential_of(
    headers: Headers, cookies: Mapping[bytes, bytes], session_cookie: bytes, path: bytes
) -> Credential | None:
    """Return the credential of a request: its session, else its token. The API alone accepts tokens."""
    if key := cookies.get(session_cookie):
        return Credential(key.decode("latin-1"))
    token = _BEARER.fullmatch(headers.getRawHeaders(b"Authorization", [b""])[0])
    if token is None or not path.startswith(b"/api/"):
        return None
    return Credential(token[1].decode("latin-1"), is_token=True)


def likely_credential(data: bytes, session_cookie: bytes) -> Credential | None:
    """Guess the credential of the first bytes of a request, before they are parsed."""
    if key := _cookie_line(session_cookie).search(data):
        return Credential(key[1].decode("latin-1"))
    if token := _BEARER_LINE.search(data):
        return Credential(token[1].decode("latin-1"), is_token=True)
    return None


@cache
def _cookie_line(name: bytes) -> re.Pattern[bytes]:
    return re.compile(rb"\r\ncookie:[^\r\n]*?[ ;]" + re.escape(name) + rb"=([^;\s]+)", re.IGNORECASE)
