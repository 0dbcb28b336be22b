"""Recognise requests that stop robots.

The process with the links answers them, also without the pages process. All functions are pure.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from urllib.parse import unquote

RIGHT = "fleet.stop_right"  # the extension of a stop's scope with its person's right (`teleop.stop.rights`)

_ADDRESSES = re.compile(rb"/(api/(v1/)?)?(robots/(?P<slug>[^/]+)/stop|stop|stop-all)/?")


def is_stop(method: bytes, path: bytes) -> bool:
    """Return whether this method and path (without query) are those of a stop."""
    return method == b"POST" and _ADDRESSES.fullmatch(path) is not None


def slug_of(path: str) -> str | None:
    """Return the robot that a stop at this path is for; None: all robots."""
    found = _ADDRESSES.fullmatch(path.encode(errors="replace"))
    return unquote(found["slug"].decode(errors="replace")) if found and found["slug"] else None


def is_of_api(path: str) -> bool:
    """Return whether programs use this address: they get JSON."""
    return path.startswith("/api/")


def is_head_of_stop(method: bytes, uri: bytes) -> bool:
    """Return whether this method and URI (with query) are those of a stop."""
    return is_stop(method, uri.partition(b"?")[0])


def without_query(line: bytes) -> bytes:
    """Return the request line of a stop without its query, which has no effect; other lines unchanged."""
    method, _, rest = line.partition(b" ")
    uri, _, version = rest.rpartition(b" ")
    return b" ".join((method, uri.partition(b"?")[0], version)) if is_head_of_stop(method, uri) else line


def needs_no_body(method: bytes, uri: bytes, headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Return whether the head of a stop is enough. The names of the headers are in lower case.

    The body is needed only for a form's CSRF token (`teleop.stop.views`). Programs without cookies send none.
    """
    if not is_head_of_stop(method, uri):
        return False
    names = {name for name, _ in headers}
    return b"x-csrftoken" in names or (b"authorization" in names and b"cookie" not in names)
