"""Guards before Daphne's protocols, without a network."""

import asyncio
from types import SimpleNamespace

import pytest
from twisted.internet.protocol import Factory as Wrapped
from twisted.internet.protocol import Protocol
from twisted.internet.testing import StringTransport

from fleet.server import limits
from fleet.server.command import daphne_server  # first: it chooses Twisted's reactor
from fleet.server.front import Front
from fleet.server.guard import Factory
from fleet.server.websocket import WebSocket

HANDSHAKE = b"GET /ws/ HTTP/1.1\r\nHost: lab\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n"


@pytest.fixture
def guard():
    found = Factory(Wrapped.forProtocol(Protocol), Front(None, session_cookie="session")).buildProtocol(None)
    found.callLater = lambda *_: SimpleNamespace(cancel=lambda: None, reset=lambda _s: None)
    found.makeConnection(StringTransport())
    return found


async def test_a_client_sends_little_while_its_messages_wait(guard):
    guard.dataReceived(HANDSHAKE)
    await asyncio.sleep(0)
    guard.is_accepted = True
    messages = asyncio.Queue()
    socket = WebSocket(guard, messages.get, None)
    for _ in range(1 + limits.UNREAD_BYTES // limits.MESSAGE_BYTES):
        guard.dataReceived(bytes(limits.MESSAGE_BYTES))
        messages.put_nowait("a message")
    assert guard.transport.producerState == "paused"
    while not messages.empty():
        await socket.receive()
    assert guard.transport.producerState == "paused"
    waits = asyncio.ensure_future(socket.receive())
    await asyncio.sleep(0.01)
    assert guard.transport.producerState == "producing"
    messages.put_nowait("a message")
    assert await waits == "a message"


def test_daphne_keeps_no_time():
    factory = daphne_server.HTTPFactory(None)
    factory.timeOut = None
    channel = factory.buildProtocol(None)
    channel.callLater = lambda *_: pytest.fail("Daphne's channel ends a connection by itself.")
    channel.makeConnection(StringTransport())
