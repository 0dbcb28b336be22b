"""Ids by which the log's lines about one request are found, from the page to the bridge."""

from __future__ import annotations

import re
from uuid import uuid4

HEADER = "X-Request-ID"


def request_id(given: str | None) -> str:
    """Return the id that a client or a proxy chose for its request, if it is one, else a new one."""
    return given if given and re.fullmatch("[A-Za-z0-9._-]{1,64}", given) else uuid4().hex


def connection_id(headers: list[tuple[bytes, bytes]]) -> str:
    """Return a new id for a connection. It begins with the id of the request that opened it, and is never the same."""
    given = dict(headers).get(HEADER.lower().encode(), b"").decode("latin-1")
    return f"{request_id(given)[:31]}-{uuid4().hex}"
