"""Find a request's credentials: a session's cookie, and a program's token. They are hints until they are looked up.

All functions are pure.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

from django.http import parse_cookie

Headers = Iterable[tuple[bytes, bytes]]  # names in lower case

_BEARER = re.compile(rb"bearer +(\S+) *", re.IGNORECASE)
_BEARER_LINE = re.compile(rb"\r\nauthorization: *bearer +([^\s]+)", re.IGNORECASE)


class Credential(NamedTuple):
    """The key of a session, or the text of a token. Nobody has checked it yet."""

    text: str
    is_token: bool = False


def credentials_of(headers: Headers, session_cookie: str, path: str) -> list[Credential]:
    """Return the credentials of a request in their order: the first valid one counts.

    A session comes before a token. The API alone accepts tokens.
    """
    session = _cookie(headers, session_cookie)
    found = [_BEARER.fullmatch(value) for name, value in headers if name == b"authorization"]
    token = found[0] if found and path.startswith("/api/") else None
    return _in_order(session.encode("latin-1") if session else None, token[1] if token else None)


def has_cookie(headers: Headers, name: str) -> bool:
    """Return whether a request has this cookie."""
    return _cookie(headers, name) is not None


def _cookie(headers: Headers, name: str) -> str | None:
    cookies = "; ".join(value.decode("latin-1") for key, value in headers if key == b"cookie")
    return parse_cookie(cookies).get(name)


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
