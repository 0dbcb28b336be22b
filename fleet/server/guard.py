"""Connections with limits: only whole requests within their limits reach Daphne, one at a time.

A guard stands between each connection and Daphne's protocol, as a wrapper of Twisted (`twisted.protocols.policies`).
Behind Daphne, the ASGI application `fleet.server.front` finds the guard of its request in `GUARD`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from twisted.internet.interfaces import IProtocolNegotiationFactory, IPushProducer, ISSLTransport
from twisted.protocols.policies import ProtocolWrapper, TimeoutMixin, WrappingFactory
from zope.interface import implementer, noLongerProvides

from fleet.server import limits
from fleet.server.incoming import Head, IncomingRequest
from fleet.server.limits import HttpRefusal
from fleet.server.turns import Key

GUARD: ContextVar[Guard] = ContextVar("guard")  # of the request whose application runs

REFUSAL_READ_WITHIN_S = 1.0  # time for a refused client to read the refusal

# Headers that are for this connection only; the root path would come from a stranger.
_NOT_PASSED = {b"content-length", b"transfer-encoding", b"expect", b"te", b"trailer", b"daphne-root-path"}


class Guard(ProtocolWrapper, TimeoutMixin):  # type: ignore[misc]  # Twisted's types are skipped
    """One connection. Requests come over it one after the other, or a WebSocket's bytes."""

    def __init__(self, factory: Any, protocol: Any) -> None:
        super().__init__(factory, protocol)
        self.body = b""  # of the request that is being answered
        # Called when the connection ends before the answer
        self.when_lost: Callable[[], object] | None = None
        # Takes bytes of a WebSocket before Daphne gets them; False: it does not
        self.take: Callable[[bytes], bool] = lambda _: False
        self.writable = asyncio.Event()  # set while the client reads what is sent
        self.writable.set()
        self.is_accepted = False  # a WebSocket whose handshake is accepted
        self.is_heard = False  # a WebSocket whose application waits for a message
        self.unread_bytes = 0  # of a WebSocket, since its application last waited
        self._unhandled = b""  # received bytes that wait for their turn
        self._owner: Key = ()  # for whom they are handled
        self._address = ""  # for which the connection counts
        self._reserved = 0  # bytes of the body, as they count for the limit of all bodies
        self._is_between = False  # between two requests
        self._is_answering = False
        self._is_begun = False  # the application answers, and says when it is over
        self._is_cut = False  # the client may still send a body that nobody reads
        self._is_websocket = False
        self._reads_always = False  # a WebSocket whose application bounds what it answers
        self._leaving = False  # the connection closes, and nothing more is read
        self._reads = True
        self._incoming = self._next_request()

    @property
    def server(self) -> Any:
        """Return the state that connections share: `fleet.server.front.Front`."""
        return self.factory.front

    @property
    def is_lost(self) -> bool:
        """Whether the connection has ended."""
        return self.wrappedProtocol is None

    def makeConnection(self, transport: Any) -> None:
        """Handle a new connection: take a place, or refuse it."""
        super().makeConnection(transport)
        transport.registerProducer(_Flow(self), True)
        self._address = self.server.address_of(transport)
        self._owner = self.server.owner_of(None, self._address)
        self.setTimeout(limits.HEAD_S)
        if not self.server.serves(self):
            self.refuse(limits.not_a_proxy())
        elif not self.server.entered(self):
            self.refuse(limits.busy())

    def dataReceived(self, data: bytes) -> None:
        """Store received bytes of a request until it is their turn. Pass those of a WebSocket on."""
        if self._is_websocket:
            self._pass_on(data)
            return
        if not self._unhandled:
            self._owner = self.server.likely_owner(data, self._owner)
            self._ask_for_turn()
        self._unhandled += data
        self.read_or_pause()

    def _ask_for_turn(self) -> None:
        if not self._is_answering:
            self.server.work.add(self._take_turn, self._owner)

    def _take_turn(self) -> None:
        data, self._unhandled = self._unhandled, b""
        if not data or self._leaving or self._is_answering:
            self._unhandled = data
            return
        if self._is_between:
            self._is_between = False
            self.setTimeout(limits.HEAD_S)
        try:
            self._unhandled = self._feed(data)
        except HttpRefusal as refusal:
            self.refuse(refusal)
        if self._incoming.is_whole and self._incoming.head is not None and not self._leaving:
            self._hand_on(self._incoming, self._incoming.head)
        self.read_or_pause()

    def _feed(self, data: bytes) -> bytes:
        request = self._incoming
        had_head = request.head is not None
        rest = request.feed(data)
        if request.head is not None and not had_head and not request.is_whole:
            self.setTimeout(limits.BODY_S)
            if request.head.values(b"expect") and request.head.version == "1.1":
                self.transport.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        return rest

    def _next_request(self) -> IncomingRequest:
        return IncomingRequest(self.server.session_cookie, self._reserve)

    def _reserve(self, more_bytes: int) -> None:
        if not self.server.bodies.take(self._address, more_bytes):
            raise limits.busy()
        self._reserved += more_bytes

    def _free(self) -> None:
        self.server.bodies.give_back(self._address, self._reserved)
        self._reserved = 0

    def _hand_on(self, request: IncomingRequest, head: Head) -> None:
        """Let Daphne answer the request. It gets no body: the application takes it from here."""
        self.setTimeout(limits.HEAD_S)  # until the application begins: Daphne may refuse the request itself
        self.body, self._is_cut = request.body, request.is_cut
        left_out = _NOT_PASSED if head.is_handshake else _NOT_PASSED | {b"upgrade"}
        if request.is_last:
            left_out = left_out | {b"connection"}
        lines = [b"%s: %s\r\n" % (name, value) for name, value in head.headers if name not in left_out]
        if request.is_last:
            lines.append(b"connection: close\r\n")
        self._incoming = self._next_request()
        # The connection of a stop may close for a new one: a known person's stop is sent all the same, and many stops
        # that wait for their answers refuse no new connection.
        if not head.is_stop:
            self.server.open.working(self)
        self._is_websocket, self._is_answering = head.is_handshake, not head.is_handshake
        if head.is_handshake:  # else Autobahn would look for a TLS connection here
            noLongerProvides(self, ISSLTransport)
        first = b"%s %s HTTP/%s\r\n" % (head.method, head.target, head.version.encode())
        current = GUARD.set(self)
        try:
            self.wrappedProtocol.dataReceived(first + b"".join(lines) + b"\r\n")
        finally:
            GUARD.reset(current)
        self.read_on()

    @property
    def patience_s(self) -> float | None:
        """The longest time until the client must have sent what is missing; None: without limit."""
        if self._is_between:
            return limits.IDLE_S
        if self._is_answering or self._is_websocket:
            return None
        return limits.HEAD_S if self._incoming.head is None else limits.BODY_S

    def _pass_on(self, data: bytes) -> None:
        """Let Daphne handle bytes of a WebSocket. Until it is accepted, a page may send only its handshake.

        One read may hold thousands of tiny messages: Daphne gets a piece at a time, while the client may send more.
        """
        self._unhandled += data
        while (unhandled := self._unhandled) and self._may_send:
            piece, self._unhandled = unhandled[: limits.PIECE_BYTES], unhandled[limits.PIECE_BYTES :]
            self.unread_bytes = len(piece) + (0 if self.is_heard and self.is_accepted else self.unread_bytes)
            if not self.is_accepted and self.unread_bytes > limits.HANDSHAKE_BYTES:
                self.transport.abortConnection()
                return
            if not self.take(piece):
                self.wrappedProtocol.dataReceived(piece)
        self.read_or_pause()

    @property
    def _may_send(self) -> bool:
        """Whether the client may send more."""
        if self._is_websocket:
            takes = self._reads_always or self.writable.is_set()
            has_room = self.unread_bytes <= limits.UNREAD_BYTES and takes
        else:
            has_room = len(self._unhandled) <= limits.UNHANDLED_BYTES
        return has_room and not self._leaving

    def always_read(self) -> None:
        """From now on read also while the client reads nothing."""
        self._reads_always = True

    def read_on(self) -> None:
        """Handle what waits, then read on."""
        if self._is_websocket:
            self._pass_on(b"")
        self.read_or_pause()

    def read_or_pause(self) -> None:
        """Read from the client only while it may send more."""
        reads = self._may_send
        if reads != self._reads:
            self._reads = reads
            (self.transport.resumeProducing if reads else self.transport.pauseProducing)()

    def begin(self) -> None:
        """Note that the application begins to answer. It calls `over` at the end."""
        self._is_begun = True
        self.setTimeout(None)

    def over(self) -> None:
        """Handle the end of an answer, or of the work for it: the next request may come."""
        self.when_lost, self.body = None, b""
        self._free()
        self._is_answering = self._is_begun = False
        if self._leaving or self.is_lost:
            return
        self.server.open.waiting(self)
        self._is_between = True
        self.setTimeout(limits.IDLE_S)
        if self._unhandled:
            self._ask_for_turn()

    def timeoutConnection(self) -> None:
        """Handle a timeout: close an idle connection, refuse a request that is incomplete."""
        if self._leaving or self._is_between or not self._incoming.is_begun:
            self.transport.abortConnection()
        else:
            body_comes = self._incoming.head is not None
            self.refuse(limits.too_slow(limits.BODY_S if body_comes else limits.HEAD_S))

    def refuse(self, refusal: HttpRefusal) -> None:
        """Send the refusal, read nothing more, and close the connection soon after."""
        if not self._leaving:
            self.transport.write(refusal.response())
            self._leave()

    def _leave(self) -> None:
        self._leaving = True
        self._free()
        self.read_or_pause()
        self.transport.unregisterProducer()
        if ISSLTransport.providedBy(self.transport):  # it still holds the last bytes
            self.transport.loseConnection()
        elif hasattr(self.transport, "loseWriteConnection"):
            self.transport.loseWriteConnection()
        # If the connection closed at once, the client might not get the response.
        self.setTimeout(REFUSAL_READ_WITHIN_S)

    # The connection, as Daphne's protocols see it

    def loseConnection(self) -> None:
        """Close the connection once everything is sent."""
        if self._is_cut:
            self._leave()
        elif not self._leaving:
            self._leaving = True
            self.transport.unregisterProducer()
            self.setTimeout(limits.UNREAD_S)
            super().loseConnection()

    def write_at_once(self, data: bytes) -> None:
        """Write, and send it without a turn of the loop if no older bytes wait."""
        transport = self.transport
        if self._leaving or not self.writable.is_set():
            self.write(data)
        elif ISSLTransport.providedBy(transport):
            self.write(data)
            if transport.doWrite():
                transport.abortConnection()  # it is lost
        elif transport in transport.reactor.getWriters():
            self.write(data)
        else:  # without `write`, which would ask the kernel twice whether it may send
            sent = transport.writeSomeData(data)
            if isinstance(sent, Exception):
                transport.abortConnection()
            elif sent < len(data):
                self.write(data[sent:])

    def pauseProducing(self) -> None:
        """Do nothing: `read_or_pause` decides."""

    resumeProducing = unregisterProducer = pauseProducing

    def registerProducer(self, _producer: Any, _streaming: bool) -> None:
        """Do nothing: the guard itself hears whether the client reads."""

    def connectionLost(self, reason: Any) -> None:
        """Handle the end of the connection."""
        self.setTimeout(None)
        self._leaving = True
        self._unhandled = b""
        self.server.open.left(self)
        if not self._is_begun:  # Daphne may have refused the request itself
            self._free()
        super().connectionLost(reason)
        if self.when_lost is not None:
            self.when_lost()


@implementer(IPushProducer)
class _Flow:
    """Hear from a connection whether its client reads. After `UNREAD_S` without reading, disconnect."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard

    def pauseProducing(self) -> None:
        self._guard.writable.clear()
        self._guard.setTimeout(limits.UNREAD_S)
        self._guard.read_or_pause()

    def resumeProducing(self) -> None:
        self._guard.setTimeout(self._guard.patience_s)
        self._guard.writable.set()
        self._guard.read_on()

    def stopProducing(self) -> None:
        pass


@implementer(IProtocolNegotiationFactory)
class Factory(WrappingFactory):  # type: ignore[misc]
    """Makes guards. `front` has the state that they share."""

    protocol = Guard

    def __init__(self, daphne_factory: Any, front: Any) -> None:
        super().__init__(daphne_factory)
        self.front = front
        self.noisy = False  # Twisted writes no line when it starts and ends

    def acceptableProtocols(self) -> list[bytes]:
        """Return the protocols that a browser may choose over TLS. Without them, Twisted refuses every browser."""
        return [b"http/1.1"]
