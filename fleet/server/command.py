"""The server and its command line."""

from __future__ import annotations

import os
import resource
import time
from argparse import Namespace
from collections.abc import Callable
from typing import Any

from daphne import server as daphne_server  # first: it chooses Twisted's reactor
from daphne.cli import CommandLineInterface
from twisted.internet import reactor, task

from fleet.base import stop_addresses
from fleet.base.network_addresses import network_of
from fleet.server import channel, credentials, limits, pages_process, websocket
from fleet.server.connections import Connections, Places
from fleet.server.turns import Key, Turns, WorkQueue
from robots.shared.processes.scheduling import Garbage, ask_for_priority

STOPPERS, OTHERS = "people who stop robots", "others"  # owners of work
GARBAGE_S = 0.1  # between two collections, so that each one has only few new objects

# Daphne's `Server.run` takes its factories from these names, and there is no other way to replace them.
daphne_server.HTTPFactory = channel.Factory
daphne_server.WebSocketFactory = websocket.Factory


class Server(daphne_server.Server):  # type: ignore[misc]  # Daphne has no types
    """Daphne's server, with counts of connections, requests and WebSockets."""

    keeper: pages_process.Keeper | None = None  # keeps the pages process running; None in tests of the server
    rights: Any = None  # who may stop what: the application sets it (`teleop.stop.rights`)
    metrics: Callable[[], bytes]  # of this process: the application sets it (`teleop.live.metrics`)

    def __init__(self, *args: Any, **options: Any) -> None:
        from django.conf import settings  # the application was imported before

        super().__init__(*args, **options)
        self.session_cookie = settings.SESSION_COOKIE_NAME.encode()
        self.open: Connections[Any] = Connections()
        self.requests = Places(limits.REQUESTS, limits.REQUESTS_OF_ADDRESS)
        self.websockets = Places(limits.WEBSOCKETS, limits.WEBSOCKETS_OF_ADDRESS)
        self.strangers = Turns(limits.STRANGERS_AT_ONCE)
        self.forward: pages_process.Forward | None = None  # None: this process answers all requests
        self.work = WorkQueue(lambda work: reactor._asyncioEventloop.call_soon(work))
        self.bodies_bytes = 0  # size of the bodies of all requests that arrive or wait for their responses

    def run(self) -> None:
        """Run the server until it has to end."""
        _least, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))  # each connection is a file
        if self.keeper is not None:
            self.forward = pages_process.Forward(self.keeper.path)
            self.keeper.programs.unlink(missing_ok=True)
            self.endpoints: list[str] = [*self.endpoints, pages_process.endpoint(self.keeper.programs)]
            reactor.addSystemEventTrigger("before", "shutdown", self.keeper.end)
            reactor.callWhenRunning(self._prefer_commands)
        super().run()

    def _prefer_commands(self) -> None:
        """Give the loop's thread priority, and collect garbage in the loop between commands.

        The many objects of Django are never searched.
        """
        ask_for_priority()
        garbage = Garbage()
        self._collecting = task.LoopingCall(
            lambda: garbage.collect(time.monotonic(), waits=self.websockets.taken > 0)
        )
        self._collecting.start(GARBAGE_S)

    def create_application(self, protocol: Any, scope: dict[str, Any]) -> Any:
        """Start the application for a request or a WebSocket."""
        if scope["type"] == "websocket":
            scope["extensions"] = {
                websocket.DIRECT_RECEIVER: protocol.set_direct_receiver,
                websocket.DIRECT_SENDER: protocol.send_directly,
            }
        elif (right := getattr(protocol, "right", None)) is not None:
            scope["extensions"] = {stop_addresses.RIGHT: right}
        return super().create_application(protocol, scope)

    def listen_success(self, port: Any) -> None:
        """Let the kernel hold many new connections, whoever opened the socket."""
        port.socket.listen(limits.BACKLOG)
        super().listen_success(port)

    def owner_of(self, credential: credentials.Credential | None, address: str) -> Key:
        """Return for whom work is done: people who are known to stop robots have turns between all other work."""
        person = None
        if self.rights is not None and credential is not None:
            person = self.rights.person_behind(credential)
        return (OTHERS, address) if person is None else (STOPPERS, person, credential)

    def likely_owner(self, data: bytes, before: Key) -> Key:
        """Return for whom these bytes are handled, before they are parsed.

        `before`: the owner of the bytes before them.
        """
        if not data.startswith(b"POST "):
            return before
        likely = credentials.likely_credentials(data, self.session_cookie)
        owners = (self.owner_of(credential, "") for credential in likely)
        return next((owner for owner in owners if owner[0] is STOPPERS), before)

    @staticmethod
    def address_of(transport: Any) -> str:
        """Return the address for which a connection counts; blank: a Unix socket."""
        host = getattr(transport.getPeer(), "host", None)
        return network_of(host) if host else ""

    def entered(self, connection: channel.Channel) -> bool:
        """Return whether there is a place for a new connection.

        If necessary, close the oldest waiting connection.
        """
        address = (
            None if self.proxy_forwarded_address_header else self.address_of(connection.transport) or None
        )
        admitted, leaves = self.open.admit(connection.transport, address)
        if leaves is not None:
            leaves.abortConnection()
        return admitted

    def working(self, connection: channel.Channel) -> None:
        """Note that a connection has sent a complete request."""
        self.open.working(connection.transport)

    def waiting(self, connection: channel.Channel) -> None:
        """Note that a connection's request was answered."""
        self.open.waiting(connection.transport)

    def is_ours(self, transport: Any) -> bool:
        """Return whether a connection came through the socket for pages processes of this account."""
        keeper = self.keeper
        return keeper is not None and getattr(transport.getHost(), "name", None) == os.fsencode(
            keeper.programs
        )

    def left(self, transport: Any) -> None:
        """Note that a connection is closed."""
        self.open.left(transport)


class CommandLine(CommandLineInterface):  # type: ignore[misc]
    """Daphne's command line, with smaller WebSocket messages and a process for the pages."""

    server_class = Server

    def __init__(self) -> None:
        super().__init__()
        self.parser.set_defaults(
            websocket_max_message_size=limits.MESSAGE_BYTES, websocket_max_frame_size=limits.MESSAGE_BYTES
        )

    def run(self, args: list[str]) -> None:
        """Run the server until it has to end."""
        asked: Namespace = self.parser.parse_args(args)
        os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
        from django.conf import settings

        keeper = Server.keeper = pages_process.Keeper(settings.FLEET_RUN_DIR, asked.application)
        try:
            super().run(args)
        finally:
            keeper.end()
            keeper.wait()
