"""Recognise requests that stop robots.

The process with the links answers them, also without the pages process. All functions are pure.
"""

from __future__ import annotations

import re

from twisted.web.http_headers import Headers

_ADDRESSES = re.compile(rb"/(api/(v1/)?)?(robots/[^/]+/stop|stop|stop-all)/?")


def is_stop(method: bytes, path: bytes) -> bool:
    """Return whether this method and path (without query) are those of a stop."""
    return method == b"POST" and _ADDRESSES.fullmatch(path) is not None


def is_head_of_stop(method: bytes, uri: bytes) -> bool:
    """Return whether this method and URI (with query) are those of a stop."""
    return is_stop(method, uri.partition(b"?")[0])


def without_query(line: bytes) -> bytes:
    """Return the request line of a stop without its query, which has no effect; other lines unchanged."""
    method, _, rest = line.partition(b" ")
    uri, _, version = rest.rpartition(b" ")
    return b" ".join((method, uri.partition(b"?")[0], version)) if is_head_of_stop(method, uri) else line


def needs_no_body(method: bytes, uri: bytes, headers: Headers) -> bool:
    """Return whether the head of a stop is enough, because the body is needed only for a form's token.

    See `teleop.stop.views`.
    """
    return is_head_of_stop(method, uri) and headers.hasHeader(b"X-CSRFToken")
