"""Recognises requests that stop robots: the process with the links answers them, also without the pages. Pure."""

from __future__ import annotations

import re

from twisted.web.http_headers import Headers

_ADDRESSES = re.compile(rb"/(api/(v1/)?)?(robots/[^/]+/stop|stop|stop-all)/?")


def is_stop(method: bytes, path: bytes) -> bool:
    """Return whether this is the address of a stop, without its query."""
    return method == b"POST" and _ADDRESSES.fullmatch(path) is not None


def is_head_of_stop(method: bytes, uri: bytes) -> bool:
    """The same, of a request line."""
    return is_stop(method, uri.partition(b"?")[0])


def without_query(line: bytes) -> bytes:
    """The request line of a stop without its query, which says nothing; any other line as it is."""
    method, _, rest = line.partition(b" ")
    uri, _, version = rest.rpartition(b" ")
    return b" ".join((method, uri.partition(b"?")[0], version)) if is_head_of_stop(method, uri) else line


def needs_no_body(method: bytes, uri: bytes, headers: Headers) -> bool:
    """Return whether the head of a stop says all: the body is read only for a form's token (`teleop.stop.views`)."""
    return is_head_of_stop(method, uri) and headers.hasHeader(b"X-CSRFToken")
