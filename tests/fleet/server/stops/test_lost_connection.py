"""A known person's stop needs no reader: its connection may close while its right is read."""

import asyncio
from types import SimpleNamespace

from twisted.internet.error import ConnectionAborted
from twisted.internet.testing import StringTransport
from twisted.python.failure import Failure

from fleet.server.channel import Factory

STOP = (
    b"POST /api/v1/stop HTTP/1.1\r\nHost: lab\r\nAuthorization: Bearer fleet_x\r\nContent-Length: 2\r\n\r\n{}"
)


class Server:
    """The parts of the server that a stop uses. The right is read when the test says so."""

    session_cookie, root_path, request_buffer_size = b"session", "", 8192
    proxy_forwarded_address_header = proxy_forwarded_port_header = proxy_forwarded_proto_header = None
    bodies_bytes = 0

    def __init__(self):
        loop = asyncio.get_running_loop()
        self.right = loop.create_future()
        self.asked = asyncio.Event()
        self.rights = SimpleNamespace(ask=self._ask)
        self.work = SimpleNamespace(add=lambda work, _owner: loop.call_soon(work))
        self.events = asyncio.Queue()  # what the application receives
        self.strangers = SimpleNamespace(ask=lambda _key, begin: begin(), over=lambda: None)
        self.forward = lambda _request: None

    def _ask(self, _credential):
        self.asked.set()
        return self.right

    def create_application(self, _request, _scope):
        return self.events

    def entered(self, _connection):
        return True

    def owner_of(self, *_):
        return ()

    def likely_owner(self, *_):
        return ()

    def address_of(self, _transport):
        return ""

    def protocol_connected(self, _request): ...

    def protocol_disconnected(self, _request): ...

    def left(self, _transport): ...


async def test_a_stop_is_sent_although_its_connection_has_closed():
    server = Server()
    factory = Factory.__new__(Factory)
    factory.server = server
    channel = factory.buildProtocol(None)
    channel.callLater = lambda *_: SimpleNamespace(cancel=lambda: None, reset=lambda _s: None)
    channel.makeConnection(StringTransport())
    channel.dataReceived(STOP)
    await asyncio.wait_for(server.asked.wait(), 5)
    channel.connectionLost(Failure(ConnectionAborted()))
    assert server.events.empty()
    server.right.set_result(SimpleNamespace(robots_at=lambda _path: ["a robot"], key=()))
    kinds = [(await asyncio.wait_for(server.events.get(), 5))["type"] for _ in range(2)]
    assert kinds == ["http.request", "http.disconnect"]
