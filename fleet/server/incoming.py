"""A request while it arrives, within the limits. A stop gets through although its head breaks a limit or a rule."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser

from fleet.base.web import stop_addresses
from fleet.server import limits
from fleet.server.credentials import has_cookie
from fleet.server.limits import HttpRefusal

# CONNECT is missing: after it, the bytes of a body would be those of another protocol.
METHODS = {b"GET", b"HEAD", b"POST", b"PUT", b"PATCH", b"DELETE", b"OPTIONS", b"TRACE"}

_END = b"\r\n\r\n"
_NEXT_LINE = b"\x85"  # Daphne itself would refuse a header with it, also that of a stop
_LINE = re.compile(rb"([\w!#$%&'*+.^`|~-]+):[ \t]*([\x20-\x7e\x80-\x84\x86-\xff\t]*?)[ \t]*")


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
    """One request. `feed` takes its bytes, and raises `HttpRefusal` at the first that exceeds a limit.

    `reserve` is called with the number of bytes of the body before they are kept, and may raise `HttpRefusal`.
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
        self._target = b""
        self._headers: list[tuple[bytes, bytes]] = []
        self._parts: list[bytes] = []
        self._counted = self._most = 0  # bytes of the body
        self._missing = 0  # bytes of a body whose length is known
        self._parser = HttpRequestParser(self)

    @property
    def is_begun(self) -> bool:
        """Whether any byte has come."""
        return bool(self._raw)

    def feed(self, data: bytes) -> bytes:
        """Take bytes; return those behind the request."""
        if self.head is None:
            data = self._feed_head(data)
        if self.head is None or self.is_whole:
            return data
        if self.is_last:
            self._parse(data)
            return b""
        part, rest = data[: self._missing], data[self._missing :]
        self._missing -= len(part)
        self._keep(part)
        if not self._missing:
            self._end()
        return rest

    def _feed_head(self, data: bytes) -> bytes:
        self._raw = (self._raw + data).lstrip(b"\r\n")
        raw, end, rest = self._raw.partition(_END)
        try:
            _check_size(raw + end[:2])  # so its last line ends, too
            if not end:
                return b""
            self._parse(_with_short_target(raw) + end)
            parser = self._parser
            head = Head(parser.get_method(), self._target, parser.get_http_version(), self._headers)
            if not _is_well_formed(head, raw):
                raise limits.malformed()
        except HttpRefusal:
            self.head = _stop_in(raw)
            if self.head is None:
                raise
            self.is_whole = self.is_last = self.is_cut = True
            return b""
        self.head = head
        self._begin_body(head)
        return rest

    def _begin_body(self, head: Head) -> None:
        self.is_whole = False  # the parser is at the end of a head, and takes only bodies in chunks
        length = 0 if head.is_handshake else int((head.values(b"content-length") or [b"0"])[0])
        self.is_last = bool(head.values(b"transfer-encoding")) and not head.is_handshake
        if (length or self.is_last) and stop_addresses.needs_no_body(head.method, head.target, head.headers):
            self.is_whole = self.is_last = self.is_cut = True
            return
        self._most = limits.most_body_bytes(session_cookie=has_cookie(head.headers, self._session_cookie))
        self._count(length)
        self._missing = length
        self.is_whole = not (length or self.is_last)

    def _count(self, more: int) -> None:
        self._counted += more
        if self._counted > self._most:
            raise limits.body_too_large(self._most)
        if not self._is_stop:  # strangers' bodies must not use up its memory
            self._reserve(more)

    def _keep(self, part: bytes) -> None:
        """Keep a part of the body; of a stop's body only the beginning."""
        room = limits.STOP_BODY_BYTES - sum(map(len, self._parts)) if self._is_stop else len(part)
        self._parts.append(part[: max(0, room)])

    @property
    def _is_stop(self) -> bool:
        return self.head is not None and self.head.is_stop

    def _end(self) -> None:
        if not self.is_whole:
            self.body, self._parts, self.is_whole = b"".join(self._parts), [], True

    def _parse(self, data: bytes) -> None:
        try:
            self._parser.feed_data(data)
        except HttpParserUpgrade:
            pass
        except HttpParserError as error:
            if isinstance(error.__context__, HttpRefusal):  # raised by `on_body`
                raise error.__context__ from None
            if not self.is_whole:
                raise limits.malformed() from error

    # Called by the parser. Behind a body in chunks, which ends the connection, nothing is read.

    def on_url(self, part: bytes) -> None:
        """Take a part of the target."""
        if not self.is_whole:
            self._target += part

    def on_header(self, name: bytes, value: bytes) -> None:
        if not self.is_whole and _NEXT_LINE not in value:
            self._headers.append((name.lower(), value.strip()))

    def on_body(self, part: bytes) -> None:
        """Take a part of a body in chunks."""
        if not self.is_whole:
            self._count(len(part))
            self._keep(part)

    def on_message_complete(self) -> None:
        self._end()


def _check_size(raw: bytes) -> None:
    """Raise HttpRefusal if a head, which may be incomplete, is too large."""
    first, is_line, _ = raw.partition(b"\r\n")
    if len(stop_addresses.without_query(first)) > (limits.URL_BYTES if is_line else limits.HEAD_BYTES):
        raise limits.url_too_long()
    if len(raw) > limits.HEAD_BYTES or raw.count(b"\r\n") > limits.HEADERS + 1:
        raise limits.head_too_large()


def _with_short_target(raw: bytes) -> bytes:
    first, end, rest = raw.partition(b"\r\n")
    return stop_addresses.without_query(first) + end + rest if len(first) > limits.URL_BYTES else raw


def _is_well_formed(head: Head, raw: bytes) -> bool:
    """Return whether all programs read this head alike, and it is one for pages."""
    return (
        head.method in METHODS
        and head.target.startswith(b"/")
        and head.version in ("1.0", "1.1")
        and b"\n " not in raw
        and b"\n\t" not in raw
        and (head.is_stop or (len(head.values(b"host")) <= 1 and _NEXT_LINE not in raw))
    )


def _stop_in(raw: bytes) -> Head | None:
    """Return the head of a stop from bytes that break a limit or a rule, if they have all that a stop needs."""
    first, end, rest = raw.partition(b"\r\n")
    kept = (stop_addresses.without_query(first) + end + rest)[: limits.HEAD_BYTES]
    first, *lines = kept.split(b"\r\n")
    method, _, rest = first.partition(b" ")
    if len(kept) == limits.HEAD_BYTES:
        lines = lines[:-1]  # it may be cut
    headers = [
        (found[1].lower(), found[2]) for found in map(_LINE.fullmatch, lines[: limits.HEADERS]) if found
    ]
    target = rest.rpartition(b" ")[0]
    if stop_addresses.needs_no_body(method, target, headers):
        return Head(method, target, "1.1", headers)
    return None
