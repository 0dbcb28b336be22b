"""HTTP connections with limits: a request that exceeds a limit is refused at once and not read further."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from io import BytesIO
from typing import Any

from daphne import http_protocol
from daphne.utils import parse_x_forwarded_for
from twisted.web import http

from fleet.base import stop_addresses
from fleet.base.network_addresses import network_of
from fleet.server import credentials, limits
from fleet.server.limits import Refusal, Refused
from fleet.server.turns import Key

STOP_RIGHT = (
    "fleet.stop_right"  # the extension of a stop's scope with the person's right (`teleop.stop.rights`)
)
REFUSAL_READ_WITHIN_S = 1.0  # time for a refused client to read the refusal


class Request(http_protocol.WebRequest):  # type: ignore[misc]  # Daphne has no types
    """One request. Its body is kept in memory, and its size is limited."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._parsePOSTFormSubmission = False  # Django parses forms
        self._most_bytes = limits.BODY_BYTES
        self._counted_bytes = 0
        self._place: str | None = None
        self._has_turn = False  # among the stops of strangers
        self.right: Any = None  # of a stop: its person's right to stop this robot (`teleop.stop.rights`)
        self._is_judged = True  # False while a stop waits for its right
        self._lost: Any = None  # why the connection ended meanwhile

    def gotLength(self, length: int | None) -> None:
        """Handle the end of the headers. `length` is the length of the body, None if it is sent in chunks."""
        self._most_bytes = limits.most_body_bytes(
            session_cookie=self.server.session_cookie in self.received_cookies
        )
        self.content = BytesIO()
        self._count(length or 0)

    def handleContentChunk(self, data: bytes) -> None:
        """Handle a part of the body. Of a stop's body only the beginning is kept."""
        self._count(max(0, self.content.tell() + len(data) - self._counted_bytes))
        if self._is_stop():
            data = data[: max(0, limits.STOP_BODY_BYTES - self.content.tell())]
        super().handleContentChunk(data)

    def _is_stop(self) -> bool:
        return stop_addresses.is_head_of_stop(self.channel._command, self.channel._path)

    def _count(self, more_bytes: int) -> None:
        if self._counted_bytes + more_bytes > self._most_bytes:
            raise Refused(limits.body_too_large(self._most_bytes))
        if self._is_stop():  # strangers' bodies must not use up its memory
            return
        if self.server.bodies_bytes + more_bytes > limits.BODIES_BYTES:
            raise Refused(limits.busy())
        self._counted_bytes += more_bytes
        self.server.bodies_bytes += more_bytes

    def forget_body(self) -> None:
        """Stop counting the body: it was handed on, or the request is over."""
        self.server.bodies_bytes -= self._counted_bytes
        self._counted_bytes = 0

    def process(self) -> Any:
        """Handle a complete request. Stops and WebSockets need no place: many requests never block them."""
        upgrade = self.requestHeaders.getRawHeaders(b"Upgrade", [b""])[0]
        if upgrade.lower() == b"websocket":  # the same condition as Daphne's
            self.forget_body()
            return super().process()
        if self.path == b"/metrics" and self.server.is_ours(self.channel.transport):
            return self._own_metrics()
        if self.server.forward is not None and stop_addresses.is_stop(self.method, self.path):
            return self._stop()
        return self._in_turn()

    def _own_metrics(self) -> None:
        """Send the metrics of this process to a pages process, which has checked the client's permission."""
        self.setHeader(b"Content-Type", b"text/plain; version=0.0.4; charset=utf-8")
        self.write(self.server.metrics())
        self.finish()

    def _stop(self) -> None:
        """Handle a stop: first find out whose it is. The answers come in turns, like the bytes of requests."""
        found = credentials.credentials_of(
            self.requestHeaders, self.received_cookies, self.server.session_cookie, self.path
        )
        if not found or self.server.rights is None:
            self._stop_of_stranger((self.address(),))
            return
        self._is_judged = False
        self._judge(found)

    def _judge(self, found: Sequence[credentials.Credential]) -> None:
        """Handle a stop with the first of these credentials that gives a right.

        A program may send a session that has ended next to its valid token.
        """
        credential, *others = found

        def judged(answer: asyncio.Future[Any]) -> None:
            right = answer.result()
            if right is None and others:
                self._judge(others)
                return
            owner = self.server.owner_of(credential, self.address())
            self.server.work.add(partial(self._stop_with, right), owner)

        self.server.rights.ask(credential).add_done_callback(judged)

    def _stop_with(self, right: Any) -> None:
        """Handle a stop of a known person here, with the links; None or another robot: in the pages process.

        A known person's stop is sent also if its connection has closed meanwhile: it needs no reader.
        """
        self._is_judged = True
        if right is not None and right.robots_at(self.path.decode("latin-1")):
            self.right = right
            super().process()
        elif self._lost is None:
            self._stop_of_stranger(right.key if right is not None else (self.address(),))
        if self._lost is not None and not self.finished:
            super().connectionLost(self._lost)

    def _stop_of_stranger(self, key: Key) -> None:
        self.server.strangers.ask(key, self._begin_as_stranger)

    def _begin_as_stranger(self) -> bool:
        if self._gone:
            return False
        self._has_turn = True
        self.server.forward(self)
        return True

    @property
    def _gone(self) -> bool:
        return self.channel is None or self._disconnected

    def _in_turn(self) -> Any:
        address = self.address()
        if not self.server.requests.take(address):
            return self.channel.refuse(limits.busy())
        self._place = address
        forward = self.server.forward
        return forward(self) if forward is not None else super().process()

    def address(self) -> str:
        """Return the network of the client, for which this request counts."""
        client, _scheme = self.seen_from()
        return network_of(str(client[0])) if client else ""

    def seen_from(self) -> tuple[list[Any] | None, str]:
        """Return address and port of the client (None on a Unix socket), and the scheme.

        They come from a proxy's headers if the proxy is trusted.
        """
        peer = [str(self.client.host), self.client.port] if hasattr(self.client, "port") else None
        scheme = "https" if self.isSecure() else "http"
        with suppress(UnicodeDecodeError):
            peer, scheme = parse_x_forwarded_for(
                self.requestHeaders,
                self.server.proxy_forwarded_address_header,
                self.server.proxy_forwarded_port_header,
                self.server.proxy_forwarded_proto_header,
                peer,
                scheme,
            )
        return peer, scheme

    def over(self) -> None:
        """Give back the request's place: it was answered, given up, or became a WebSocket.

        May be called twice.
        """
        self.forget_body()
        if self._place is not None:
            self.server.requests.give_back(self._place)
            self._place = None
        if self._has_turn:
            self._has_turn = False
            self.server.strangers.over()

    def finish(self) -> None:
        """Handle the end of the response."""
        self.over()
        super().finish()

    def connectionLost(self, reason: Any) -> None:
        """Handle the end of the connection. A stop that waits for its right keeps its body until then."""
        self.over()
        if self._is_judged:
            super().connectionLost(reason)
        else:
            self._lost = reason


class Channel(http.HTTPChannel):  # type: ignore[misc]
    """One connection. Requests come over it one after the other."""

    totalHeadersSize = 2 * limits.HEAD_BYTES  # Twisted's limit, higher than the console's own
    MAX_LENGTH = limits.HEAD_BYTES
    requestFactory = Request
    length: int | None
    _leaving = False  # the connection closes, and nothing more is read
    _head_open = False  # the request line is complete, and headers are still missing
    _body_unread = False
    _damaged = False  # a stop has a malformed or too large head, so the form of its body is unknown
    _between = False  # between two requests
    _unhandled = b""  # received bytes that wait for their turn
    _owner: Key = ()  # for whom they are handled

    @property
    def server(self) -> Any:
        """Return the server of this connection."""
        return self.factory.server

    def connectionMade(self) -> None:
        """Handle a new connection: take a place, or refuse it."""
        super().connectionMade()
        self.setTimeout(limits.HEAD_S)
        self._owner = self.server.owner_of(None, self.server.address_of(self.transport))
        if not self.server.entered(self):
            self.refuse(limits.busy())

    def resetTimeout(self) -> None:
        """Do nothing: single bytes must not extend the time in which a request has to be complete."""

    def dataReceived(self, data: bytes) -> None:
        """Store received bytes of a request until it is their turn."""
        if not self._unhandled:
            self._owner = self.server.likely_owner(data, self._owner)
            self.server.work.add(self._take_turn, self._owner)
        self._unhandled += data
        if len(self._unhandled) > limits.UNHANDLED_BYTES:
            self.transport.pauseProducing()

    def _take_turn(self) -> None:
        data, self._unhandled = self._unhandled, b""
        if data and not self._leaving:
            if len(data) > limits.UNHANDLED_BYTES and not self._waitingForTransport:
                self.transport.resumeProducing()
            self._handle(data)

    def _handle(self, data: bytes) -> None:
        if self._between:
            self._between = False
            self.setTimeout(limits.HEAD_S)
        try:
            super().dataReceived(data)
        except Refused as error:
            if not self._stops_all_the_same():
                self.refuse(error.refusal)

    def _stops_all_the_same(self) -> bool:
        """Handle a stop although its head exceeds a limit, if the head already has everything that a stop needs."""
        if not (self._head_open and self._is_of_stop()):
            return False
        self._damaged = True
        # Completes the header before, which might have continued on another line
        super().lineReceived(b"X-Cut: 1")
        if not stop_addresses.needs_no_body(self._command, self._path, self.requests[-1].requestHeaders):
            return False
        super().lineReceived(b"")
        return True

    def _is_of_stop(self) -> bool:
        return stop_addresses.is_head_of_stop(self._command, self._path)

    def lineReceived(self, line: bytes) -> None:
        """Handle a line of the head."""
        first = not hasattr(self, "_command")
        if first and len(line) > limits.URL_BYTES:
            line = stop_addresses.without_query(line)
            if len(line) > limits.URL_BYTES:
                raise Refused(limits.url_too_long())
        if self._receivedHeaderSize + len(line) > limits.HEAD_BYTES:
            raise Refused(limits.head_too_large())
        super().lineReceived(line)
        if first:
            self._head_open = hasattr(self, "_command")

    def lineLengthExceeded(self, _line: bytes) -> None:
        """Refuse a line that is too long."""
        raise Refused(limits.head_too_large() if hasattr(self, "_command") else limits.url_too_long())

    def headerReceived(self, line: bytes) -> bool:
        """Store a header. If a stop has a malformed header, ignore the header, and do not read the body."""
        if self._receivedHeaderCount >= limits.HEADERS and not self._damaged:
            raise Refused(limits.head_too_large())
        try:
            return bool(super().headerReceived(line))
        except Refused:
            if not self._is_of_stop():
                raise
            self._damaged = True
            return True

    def allHeadersReceived(self) -> None:
        """Handle a complete head. If the head of a stop is enough, do not wait for the body."""
        self._head_open = False
        request = self.requests[-1]
        if len(request.requestHeaders.getRawHeaders(b"Host", [])) > 1 and not self._is_of_stop():
            # By the rules of HTTP: two programs might read another one each
            raise Refused(limits.malformed())
        says_all = stop_addresses.needs_no_body(self._command, self._path, request.requestHeaders)
        if self._damaged or (self.length != 0 and says_all):
            request.requestHeaders.removeHeader(b"Expect")
            self.length = 0
            self._body_unread = True
        super().allHeadersReceived()
        self.setTimeout(limits.BODY_S)
        if self._body_unread:
            self.persistent = False
            request.responseHeaders.setRawHeaders(b"Connection", [b"close"])

    def allContentReceived(self) -> None:
        """Handle a complete request.

        The connection of a stop may still close for a new one: a known person's stop is sent all the same, and
        many stops that wait for their answers refuse no new connection.
        """
        if not self._is_of_stop():
            self.server.working(self)
        super().allContentReceived()

    def requestDone(self, request: Any) -> None:
        """Handle the end of a request: the next request may come over this connection."""
        if self.persistent:
            self.server.waiting(self)
        self._between = True
        self._savedTimeOut = limits.IDLE_S
        super().requestDone(request)

    def timeoutConnection(self) -> None:
        """Handle a timeout: close an idle connection, refuse a request that is incomplete."""
        if self._between or not (self.requests or self._buffer):
            self.transport.abortConnection()
        else:
            self.refuse(limits.too_slow(limits.BODY_S if self.length else limits.HEAD_S))

    def _respondToBadRequestAndDisconnect(self) -> None:
        raise Refused(limits.malformed())

    def refuse(self, refusal: Refusal) -> None:
        """Send the refusal, read nothing more, and close the connection soon after."""
        if self._leaving:
            return
        for request in self.requests:
            request.over()
        self.transport.unregisterProducer()
        self.transport.write(refusal.response())
        self._leave()

    def loseConnection(self) -> None:
        """Close the connection once everything is sent."""
        if self._body_unread:
            self.transport.unregisterProducer()
            self._leave()
        else:
            super().loseConnection()

    def _leave(self) -> None:
        self._leaving = True
        self.setTimeout(None)
        self.transport.pauseProducing()
        if hasattr(self.transport, "loseWriteConnection"):
            self.transport.loseWriteConnection()
        # If the connection closed at once, the client might not get the response.
        self.callLater(REFUSAL_READ_WITHIN_S, self.transport.abortConnection)

    def connectionLost(self, reason: Any) -> None:
        """Handle the end of the connection."""
        self._unhandled = b""
        self.server.left(self.transport)
        super().connectionLost(reason)


class Factory(http_protocol.HTTPFactory):  # type: ignore[misc]
    """Makes `Channel`s, without Twisted's wrapper for HTTP/2, which the console does not support."""

    def buildProtocol(self, _address: Any) -> Channel:
        """Return the channel of a new connection."""
        channel = Channel()
        channel.factory = self
        channel.timeOut = limits.IDLE_S
        return channel

    def log(self, request: Any) -> None:
        """Write no line for a request: nobody reads that log, and it takes a tenth of the loop's time."""
