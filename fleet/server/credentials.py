"""Find a request's credentials: a session's cookie, and a program's token. They are hints until they are looked up.

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


def credentials_of(
    headers: Headers, cookies: Mapping[bytes, bytes], session_cookie: bytes, path: bytes
) -> list[Credential]:
    """Return the credentials of a request in their order: the first valid one counts.

    A session comes before a token. The API alone accepts tokens.
    """
    token = _BEARER.fullmatch(headers.getRawHeaders(b"Authorization", [b""])[0])
    return _in_order(cookies.get(session_cookie), token[1] if token and path.startswith(b"/api/") else None)


def likely_credentials(data: bytes, session_cookie: bytes) -> list[Credential]:
    """Guess the credentials of the first bytes of a request, before they are parsed."""
    key, token = _cookie_line(session_cookie).search(data), _BEARER_LINE.search(data)
    return _in_order(key and key[1], token and token[1])


def _in_order(key: bytes | None, token: bytes | None) -> list[Credential]:
    session = [Credential(key.decode("latin-1"))] if key else []
    return [*session, Credential(token.decode("latin-1"), is_token=True)] if token else session


@cache
def _cookie_line(name: bytes) -> re.Pattern[bytes]:
    return re.compile(rb"\r\ncookie:[^\r\n]*?[ ;]" + re.escape(name) + rb"=([^;\s]+)", re.IGNORECASE)
