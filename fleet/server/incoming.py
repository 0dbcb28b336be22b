"""A request while it arrives: its head and its body, within the limits. Stops by HTTP get through with a bad head, too."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser

from fleet.server import limits, stop_addresses
from fleet.server.credentials import has_cookie
from fleet.server.limits import Refused

# CONNECT is missing: after it, the bytes of a body would be those of another protocol.
METHODS = {b"GET", b"HEAD", b"POST", b"PUT", b"PATCH", b"DELETE", b"OPTIONS", b"TRACE"}

_LINE = re.compile(rb"([\w!#$%&'*+.^`|~-]+):[ \t]*([\x20-\x7e\x80-\xff\t]*?)[ \t]*")
_END = b"\r\n\r\n"
_MAY_FOLLOW = len(_END) + 1  # bytes of a head with the greatest allowed size, at most


class Head(NamedTuple):
    """Request line and headers. The names of headers are in lower case."""

    method: bytes
    target: bytes
    version: str
    headers: list[tuple[bytes, bytes]]

    def values(self, name: bytes) -> list[bytes]:
        """Return all values of a header."""
        return [value for key, value in self.headers if key == name]

    @property
    def is_stop(self) -> bool:
        """Whether this request stops robots."""
        return stop_addresses.is_head_of_stop(self.method, self.target)

    @property
    def is_handshake(self) -> bool:
        """Whether this request opens a WebSocket, by Daphne's condition."""
        return [value.lower() for value in self.values(b"upgrade")][:1] == [b"websocket"]


class IncomingRequest:
    """One request. `feed` takes its bytes, and raises `Refused` at the first that exceeds a limit.

    `reserve` is called with the number of bytes of the body before they are kept, and may raise `Refused`.
    """

    def __init__(self, session_cookie: str, reserve: Callable[[int], None]) -> None:
        self.head: Head | None = None  # None: it has not come whole
        self.body = b""
        self.is_whole = False
        self.is_last = False  # the bytes behind it are not read: nobody knows where a next request begins
        self.is_cut = False  # nor is its own body read
        self._session_cookie = session_cookie
        self._reserve = reserve
        self._raw = b""
        self._parts: list[bytes] = []
        self._counted = 0  # bytes of the body
        self._most = 0
        self._missing = 0  # bytes of a body whose length is known
        self._chunks: HttpRequestParser | None = None

    @property
    def is_begun(self) -> bool:
        """Whether any byte has come."""
        return bool(self._raw)

    def feed(self, data: bytes) -> bytes:
        """Take bytes; return those behind the request."""
        if self.head is None:
            data = self._feed_head(data)
        if self.head is not None and not self.is_whole:
            data = self._feed_body(data)
        return data

    def _feed_head(self, data: bytes) -> bytes:
        self._raw = raw = (self._raw + data).lstrip(b"\r\n")
        end = raw.find(_END)
        try:
            if end < 0:
                _check_size(raw)
                return b""
            raw, rest = raw[: end + len(_END)], raw[end + len(_END) :]
            _check_size(raw)
            self.head, self._chunks = self._parsed(raw)
        except Refused:
            self.head = _stop_in(raw)
            if self.head is None:
                raise
            self.is_whole = self.is_last = self.is_cut = True
            return b""
        self._begin_body(self.head)
        return rest

    def _parsed(self, raw: bytes) -> tuple[Head, HttpRequestParser | None]:
        found = _Found(self._keep)
        parser = HttpRequestParser(found)
        try:
            parser.feed_data(_with_short_target(raw))
        except HttpParserUpgrade:
            pass
        except HttpParserError as error:
            raise Refused(limits.malformed()) from error
        head = Head(parser.get_method(), found.target, parser.get_http_version(), found.headers)
        if not _is_well_formed(head, raw):
            raise Refused(limits.malformed())
        return head, None if found.is_over else parser

    def _begin_body(self, head: Head) -> None:
        in_chunks = bool(head.values(b"transfer-encoding"))
        length = 0 if head.is_handshake else int((head.values(b"content-length") or [b"0"])[0])
        if (length or in_chunks) and stop_addresses.needs_no_body(head.method, head.target, head.headers):
            self.is_whole = self.is_last = self.is_cut = True
            return
        self._most = limits.most_body_bytes(session_cookie=has_cookie(head.headers, self._session_cookie))
        self._count(length)
        self._missing = length
        self.is_last = in_chunks and not head.is_handshake
        self.is_whole = not (length or self.is_last)

    def _feed_body(self, data: bytes) -> bytes:
        if self.is_last:
            self._feed_chunks(data)
            return b""
        self._keep_some(data[: self._missing])
        rest = data[self._missing :]
        self._missing = max(0, self._missing - len(data))
        if not self._missing:
            self._end()
        return rest

    def _feed_chunks(self, data: bytes) -> None:
        assert self._chunks is not None
        try:
            self._chunks.feed_data(data)
        except HttpParserError as error:
            if isinstance(error.__context__, Refused):  # raised by `_keep`
                raise error.__context__ from None
            if not self.is_whole:
                raise Refused(limits.malformed()) from error

    def _keep(self, part: bytes | None) -> None:
        """Keep a part of a body in chunks; None: it is over."""
        if self.is_whole:  # what follows is not read
            return
        if part is None:
            self._end()
        else:
            self._count(len(part))
            self._keep_some(part)

    def _count(self, more: int) -> None:
        self._counted += more
        if self._counted > self._most:
            raise Refused(limits.body_too_large(self._most))
        if not self._is_stop:  # strangers' bodies must not use up its memory
            self._reserve(more)

    def _keep_some(self, part: bytes) -> None:
        """Keep a part of the body; of a stop's body only the beginning."""
        room = limits.STOP_BODY_BYTES - sum(map(len, self._parts)) if self._is_stop else len(part)
        self._parts.append(part[: max(0, room)])

    @property
    def _is_stop(self) -> bool:
        return self.head is not None and self.head.is_stop

    def _end(self) -> None:
        self.body, self._parts, self.is_whole = b"".join(self._parts), [], True


class _Found:
    """The parts of a request that the parser has found (callbacks of httptools)."""

    def __init__(self, keep: Callable[[bytes | None], None]) -> None:
        self.target = b""
        self.headers: list[tuple[bytes, bytes]] = []
        self.is_over = False
        self._keep = keep

    def on_url(self, part: bytes) -> None:
        if not self.is_over:
            self.target += part

    def on_header(self, name: bytes, value: bytes) -> None:
        self.headers.append((name.lower(), value.strip()))

    def on_body(self, part: bytes) -> None:
        self._keep(part)

    def on_message_complete(self) -> None:
        self.is_over = True
        self._keep(None)


def _check_size(raw: bytes) -> None:
    """Raise Refused if a head, which may be incomplete, is too large."""
    first, is_line, _ = raw.partition(b"\r\n")
    if len(first) > (limits.URL_BYTES if is_line else limits.HEAD_BYTES):
        if not is_line or len(stop_addresses.without_query(first)) > limits.URL_BYTES:
            raise Refused(limits.url_too_long())
    if len(raw) > limits.HEAD_BYTES + _MAY_FOLLOW or raw.count(b"\r\n") > limits.HEADERS + 2:
        raise Refused(limits.head_too_large())


def _with_short_target(raw: bytes) -> bytes:
    first, end, rest = raw.partition(b"\r\n")
    return stop_addresses.without_query(first) + end + rest if len(first) > limits.URL_BYTES else raw


def _is_well_formed(head: Head, raw: bytes) -> bool:
    """Return whether all programs read this head alike, and it is one for pages."""
    return (
        head.method in METHODS
        and head.target.startswith(b"/")
        and head.version in ("1.0", "1.1")
        and b"\r\n " not in raw
        and b"\r\n\t" not in raw
        and (len(head.values(b"host")) <= 1 or head.is_stop)
    )


def _stop_in(raw: bytes) -> Head | None:
    """Return the head of a stop from bytes that break a limit or a rule, if they have all that a stop needs."""
    first, end, rest = raw.partition(b"\r\n")
    kept = (stop_addresses.without_query(first) + end + rest)[: limits.HEAD_BYTES]
    first, *lines = kept.split(b"\r\n")
    method, _, rest = first.partition(b" ")
    # The last line may be cut
    headers = [(found[1].lower(), found[2]) for found in map(_LINE.fullmatch, lines[:-1][: limits.HEADERS]) if found]
    target = rest.rpartition(b" ")[0]
    if stop_addresses.needs_no_body(method, target, headers):
        return Head(method, target, "1.1", headers)
    return None
