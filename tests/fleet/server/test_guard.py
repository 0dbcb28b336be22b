"""Guards before Daphne's protocols, without a network."""

import asyncio
import socket
import struct
from types import SimpleNamespace

import pytest
from twisted.internet.error import ConnectionAborted
from twisted.internet.interfaces import IProtocolNegotiationFactory, ISSLTransport
from twisted.internet.protocol import Factory as Wrapped
from twisted.internet.protocol import Protocol
from twisted.internet.tcp import Server
from twisted.internet.testing import StringTransport
from twisted.python.failure import Failure
from zope.interface import directlyProvides

from fleet.server import AT_ONCE, limits
from fleet.server.command import daphne_server  # first: it chooses Twisted's reactor
from fleet.server.front import Front
from fleet.server.guard import Factory

HANDSHAKE = (
    b"GET /ws/ HTTP/1.1\r\nHost: lab\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
READ_BYTES = 64 * 1024  # Twisted's largest read


@pytest.fixture
def guard():
    found = Factory(Wrapped.forProtocol(Protocol), Front(None, session_cookie="session")).buildProtocol(None)
    found.callLater = lambda *_: SimpleNamespace(cancel=lambda: None, reset=lambda _s: None)
    found.makeConnection(StringTransport())
    return found


@pytest.mark.parametrize("text", ["", "9" * limits.MESSAGE_BYTES])
async def test_a_client_sends_little_while_its_messages_wait(text):
    asks, heard = asyncio.Event(), asyncio.Queue()

    async def console(_scope, receive, send):
        await receive()
        await send({"type": "websocket.accept"})
        await asks.wait()
        while (event := await receive())["type"] != "websocket.disconnect":
            heard.put_nowait(event["text"])

    guard = await opened(console)
    frame, sent = text_frame(text), 0
    while guard.transport.producerState == "producing":
        frames = max(READ_BYTES // len(frame), 1)
        guard.dataReceived(frame * frames)
        sent += frames
    waiting = guard.wrappedProtocol.application_queue.qsize()
    assert waiting < 2000 and waiting * len(text) < 2 * limits.UNREAD_BYTES
    asks.set()
    for _ in range(sent):
        assert await heard.get() == text
    await asyncio.sleep(0.01)
    assert guard.transport.producerState == "producing"
    guard.connectionLost(Failure(ConnectionAborted()))


def test_browsers_may_choose_http_over_tls():
    """A browser offers protocols, a program seldom does. `test_demo.py` drives in a real browser over TLS."""
    factory = Factory(Wrapped.forProtocol(Protocol), Front(None, session_cookie="session"))
    assert IProtocolNegotiationFactory(factory).acceptableProtocols() == [b"http/1.1"]


async def test_a_body_that_no_application_gets_is_freed(guard):
    """Daphne refuses some requests itself."""
    guard.dataReceived(b"POST / HTTP/1.1\r\nHost: lab\r\nContent-Length: 4\r\n\r\nbody")
    await asyncio.sleep(0)
    assert guard.server.bodies.taken == 4
    guard.connectionLost(Failure(ConnectionAborted()))
    assert guard.server.bodies.taken == 0


async def test_bodies_of_one_address_leave_room_for_others(guard):
    guard.server.bodies.take(guard.server.address_of(guard), limits.BODIES_OF_ADDRESS_BYTES)
    guard.dataReceived(b"POST / HTTP/1.1\r\nHost: lab\r\nContent-Length: 4\r\n\r\n")
    await asyncio.sleep(0)
    assert guard.transport.value().startswith(b"HTTP/1.1 503 ")
    assert guard.server.bodies.take("another", limits.BODIES_OF_ADDRESS_BYTES)


async def test_reading_an_answer_does_not_extend_the_next_request(guard):
    guard.begin()
    guard.over()
    guard.dataReceived(b"GET / HTT")
    await asyncio.sleep(0)
    guard.transport.producer.pauseProducing()
    guard.transport.producer.resumeProducing()
    assert guard.timeOut == limits.HEAD_S


async def test_a_stop_reaches_the_console_with_any_header():
    """By a form, whose token is in its body."""
    paths = []

    async def console(scope, _receive, _send):
        paths.append(scope["path"])

    guard = by_daphne(console)
    guard.makeConnection(StringTransport())
    guard.dataReceived(
        b"POST /stop-all/ HTTP/1.1\r\nHost: lab\r\nX-Name: \xc3\x85se\r\nContent-Length: 4\r\n\r\nbody"
    )
    for _ in range(10):
        await asyncio.sleep(0)
    assert paths == ["/stop-all/"]
    guard.connectionLost(Failure(ConnectionAborted()))


def by_daphne(console):
    """A guard before Daphne's protocol."""
    front = Front(console, session_cookie="session")
    daphne = daphne_server.Server(front, endpoints=["tcp:0"])
    daphne.connections = {}
    daphne.ws_factory = daphne_server.WebSocketFactory(daphne)
    guard = Factory(daphne_server.HTTPFactory(daphne), front).buildProtocol(None)
    guard.callLater = lambda *_: SimpleNamespace(cancel=lambda: None, reset=lambda _s: None)
    return guard


async def opened(console, *kinds):
    """A guard before a WebSocket that the console has accepted."""
    guard = by_daphne(console)
    transport = StringTransport()
    transport.setTcpNoDelay = lambda _on: None
    directlyProvides(transport, kinds)
    guard.makeConnection(transport)
    guard.dataReceived(HANDSHAKE)
    for _ in range(10):
        await asyncio.sleep(0)
    return guard


async def test_a_websocket_opens_by_tls():
    """Autobahn asks a connection that looks like TLS for its certificate."""

    async def console(_scope, receive, send):
        await receive()
        await send({"type": "websocket.accept"})

    guard = await opened(console, ISSLTransport)
    assert guard.transport.value().startswith(b"HTTP/1.1 101 ")
    guard.connectionLost(Failure(ConnectionAborted()))


async def test_a_text_at_once_never_overtakes_one_that_waits():
    heard = []

    async def console(scope, receive, send):
        await receive()
        await send({"type": "websocket.accept"})
        scope["extensions"][AT_ONCE](lambda text: not text.startswith("later") and not heard.append(text))
        while (event := await receive())["type"] != "websocket.disconnect":
            heard.append(f"event {event['text']}")

    guard = await opened(console)
    for texts in (["now 1", "later", "now 2"], ["now 3"]):
        for _ in range(10):
            await asyncio.sleep(0)
        guard.dataReceived(b"".join(text_frame(text) for text in texts))
    assert heard == ["now 1", "event later", "event now 2", "now 3"]
    guard.connectionLost(Failure(ConnectionAborted()))


@pytest.fixture
def client(guard):
    """Another end of the guard's connection. `ended`: who ends it, and why; `writers`: who waits for the kernel."""
    ended, writers = [], set()
    reactor = SimpleNamespace(
        callLater=lambda _s, end, why: ended.append((end, why)),
        addReader=lambda _: None,
        removeReader=lambda _: None,
        addWriter=writers.add,
        removeWriter=writers.discard,
        getWriters=lambda: list(writers),
    )
    ours, theirs = socket.socketpair()
    with theirs:
        ours.setblocking(False)
        theirs.setblocking(False)
        port = SimpleNamespace(_realPortNumber=0)
        guard.makeConnection(Server(ours, guard, ("127.0.0.1", 1), port, 0, reactor))
        yield SimpleNamespace(socket=theirs, ended=ended, writers=writers)


async def test_a_message_leaves_without_a_turn_of_the_loop(guard, client):
    """The first of many readers does not wait for the last one. A lost connection ends, and nothing is raised."""
    guard.write_at_once(b"one")
    guard.write_at_once(b"two")
    assert client.socket.recv(100) == b"onetwo"
    assert not client.ended
    client.socket.close()
    guard.write_at_once(b"three")
    [(end, why)] = client.ended
    end(why)
    assert guard.is_lost


async def test_a_message_at_once_never_overtakes_one_that_waits(guard, client):
    sent = b""
    while not client.writers:
        sent += (piece := bytes([len(sent) // 10_000 % 256]) * 10_000)
        guard.write_at_once(piece)
    assert guard.writable.is_set()
    received = client.socket.recv(50_000)  # there is room for the last one now
    guard.write_at_once(b"last")
    while client.writers:
        next(iter(client.writers)).doWrite()
        received += client.socket.recv(1_000_000)
    assert received == sent + b"last"


def text_frame(text):
    """A text as a browser sends it, with a mask of zeros."""
    length = bytes([0xFF]) + struct.pack("!Q", len(text)) if len(text) > 125 else bytes([0x80 | len(text)])
    return b"\x81" + length + bytes(4) + text.encode()


def test_daphne_keeps_no_time():
    factory = daphne_server.HTTPFactory(None)
    factory.timeOut = None
    channel = factory.buildProtocol(None)
    channel.callLater = lambda *_: pytest.fail("Daphne's channel ends a connection by itself.")
    channel.makeConnection(StringTransport())
