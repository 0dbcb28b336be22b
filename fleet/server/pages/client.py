"""Forward requests to the pages process through its Unix socket."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from pathlib import Path
from typing import Any

from httptools import HttpParserError, HttpResponseParser

from fleet.base.web.origin import PORT_HEADER
from fleet.server import limits
from fleet.server.guard import Guard

log = logging.getLogger(__name__)

READY_S = 30.0  # the longest time that a request waits for a process that is just starting
RETRY_S = 0.05
MOST_KEPT = 50  # idle connections to the pages process
# Shorter than the pages process keeps idle connections, so that a request seldom gets a closing one
KEPT_S = 5.0
PIECE_BYTES = 65536

REPEATABLE = {"GET", "HEAD", "DELETE", "OPTIONS", "TRACE"}  # they do no harm if they come twice

# These headers are for one connection only, or are set again here.
NOT_FORWARDED = {
    *(b"connection", b"keep-alive", b"proxy-connection", b"transfer-encoding", b"te", b"trailer", b"upgrade"),
    *(b"expect", b"x-forwarded-for", b"x-forwarded-port", b"x-forwarded-proto", PORT_HEADER.lower().encode()),
}


class _Answer:
    """An answer while it arrives (callbacks of httptools)."""

    def __init__(self, *, has_body: bool) -> None:
        self.headers: list[tuple[bytes, bytes]] = []
        self.body = b""  # what has come of it since the last piece
        self.is_begun = False  # its head is whole
        self.is_sent = False  # its head is on its way to the client
        self.is_whole = False
        self.parser = HttpResponseParser(self)
        self._has_body = has_body

    def on_header(self, name: bytes, value: bytes) -> None:
        if name.lower() not in NOT_FORWARDED:
            self.headers.append((name, value))

    def on_headers_complete(self) -> None:
        if self.parser.get_status_code() >= 200:
            self.is_begun = True
            self.is_whole = not self._has_body

    def on_body(self, body: bytes) -> None:
        self.body += body

    def on_message_complete(self) -> None:
        self.is_whole = self.is_begun


class Pages:
    """The HTTP client of the pages process."""

    def __init__(self, path: Path) -> None:
        self._path = path
        # Idle connections, and since when
        self._kept: deque[tuple[asyncio.StreamReader, asyncio.StreamWriter, float]] = deque()

    async def answer(self, guard: Guard, scope: dict[str, Any], send: Any, *, behind_proxy: bool) -> None:
        """Send the answer to this request to its client, as fast as the client reads.

        If the pages process died, or does not start, refuse the request.
        """
        request = _request(scope, guard.body, behind_proxy=behind_proxy)
        answer = _Answer(has_body=scope["method"] != "HEAD")
        try:
            try:
                await self._exchange(request, answer, guard, send)
            except ConnectionError:
                if answer.is_begun or scope["method"] not in REPEATABLE:
                    raise
                answer = _Answer(has_body=scope["method"] != "HEAD")
                await self._exchange(request, answer, guard, send)
        except (OSError, HttpParserError) as error:
            log.warning("The pages process did not answer %s: %s", scope["path"], error)
            if answer.is_sent:
                guard.abortConnection()
            else:
                guard.refuse(limits.no_answer())

    async def _exchange(self, request: bytes, answer: _Answer, guard: Guard, send: Any) -> None:
        reader, writer = await self._connection()
        try:
            writer.write(request)
            while not answer.is_whole:
                if not (data := await reader.read(PIECE_BYTES)):
                    raise ConnectionResetError("It closed the connection.")
                answer.parser.feed_data(data)
                if answer.body or answer.is_whole:
                    await _pass_on(answer, guard, send)
        except BaseException:  # also if this task is cancelled, because the client has left
            writer.transport.abort()
            raise
        if answer.parser.should_keep_alive() and len(self._kept) < MOST_KEPT:
            self._kept.append((reader, writer, time.monotonic()))
        else:
            writer.close()

    async def _connection(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Return a connection. If the process is just starting, wait for it."""
        while self._kept:
            reader, writer, since_s = self._kept.pop()
            if time.monotonic() - since_s < KEPT_S and not reader.at_eof():
                return reader, writer
            writer.close()
        until_s = time.monotonic() + READY_S
        while True:
            try:
                return await asyncio.open_unix_connection(self._path)
            except OSError:
                if time.monotonic() > until_s:
                    raise
            await asyncio.sleep(RETRY_S)


async def _pass_on(answer: _Answer, guard: Guard, send: Any) -> None:
    """Send what has come of an answer: its head together with the first bytes of its body."""
    if not answer.is_sent:
        answer.is_sent = True
        status = answer.parser.get_status_code()
        await send({"type": "http.response.start", "status": status, "headers": answer.headers})
    await guard.writable.wait()
    body, answer.body = answer.body, b""
    await send({"type": "http.response.body", "body": body, "more_body": not answer.is_whole})


def _request(scope: dict[str, Any], body: bytes, *, behind_proxy: bool) -> bytes:
    """Return the bytes of the request for the pages process."""
    target = scope["raw_path"] + (b"?" + scope["query_string"] if scope["query_string"] else b"")
    headers = [(name, value) for name, value in scope["headers"] if name not in NOT_FORWARDED]
    if scope["client"] is not None:
        headers.append((b"x-forwarded-for", scope["client"][0].encode()))
        headers.append((b"x-forwarded-proto", scope["scheme"].encode()))
    if scope["server"] is not None and not behind_proxy:  # behind a proxy, its own port is unknown
        headers.append((PORT_HEADER.encode(), b"%d" % scope["server"][1]))
    if not body and scope["method"] == "POST":
        headers.append((b"content-length", b"0"))
    lines = b"".join(b"%s: %s\r\n" % header for header in headers)
    return b"%s %s HTTP/1.1\r\n%s\r\n%s" % (scope["method"].encode(), target, lines, body)
