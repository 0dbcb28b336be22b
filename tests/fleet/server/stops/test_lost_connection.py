"""A known person's stop needs no reader: its connection may close while its right is read."""

import asyncio
from types import SimpleNamespace

from twisted.internet.error import ConnectionAborted
from twisted.internet.testing import StringTransport
from twisted.python.failure import Failure

from fleet.base.web.stop_addresses import RIGHT
from fleet.server.command import daphne_server  # first: it chooses Twisted's reactor
from fleet.server.front import Front
from fleet.server.guard import Factory

STOP = (
    b"POST /api/v1/stop HTTP/1.1\r\nHost: lab\r\nAuthorization: Bearer fleet_x\r\nContent-Length: 2\r\n\r\n{}"
)


async def test_a_stop_is_sent_although_its_connection_has_closed():
    asked, sent = asyncio.Event(), asyncio.Event()
    found = asyncio.get_running_loop().create_future()
    right = SimpleNamespace(robots_at=lambda _path: ["a robot"])

    async def console(scope, _receive, _send):
        assert scope["extensions"] == {RIGHT: right}
        sent.set()

    def ask(_credential):
        asked.set()
        return found

    front = Front(console, session_cookie="session")
    front.pages = SimpleNamespace()
    front.rights = SimpleNamespace(ask=ask, person_behind=lambda _credential: None)
    daphne = daphne_server.Server(front, endpoints=["tcp:0"])
    daphne.connections = {}
    guard = Factory(daphne_server.HTTPFactory(daphne), front).buildProtocol(None)
    guard.callLater = lambda *_: SimpleNamespace(cancel=lambda: None, reset=lambda _s: None)
    guard.makeConnection(StringTransport())
    guard.dataReceived(STOP)
    await asyncio.wait_for(asked.wait(), 5)
    guard.connectionLost(Failure(ConnectionAborted()))
    assert not sent.is_set()
    found.set_result(right)
    await asyncio.wait_for(sent.wait(), 5)
