"""The server and its command line."""

from __future__ import annotations

import os
import resource
import time
from argparse import Namespace
from typing import Any

from daphne import server as daphne_server  # first: it chooses Twisted's reactor
from daphne.cli import CommandLineInterface
from twisted.internet import reactor, task

from fleet.server import channel, limits, pages_process, websocket
from fleet.server.connections import Connections, Places
from fleet.server.work_queue import WorkQueue
from robots.processes.scheduling import Garbage, prefer_this_thread

GARBAGE_S = 0.1  # between two collections: few young objects gather in that time

# `Server.run` makes its factories by these names, and offers no other way to make others.
daphne_server.HTTPFactory = channel.Factory
daphne_server.WebSocketFactory = websocket.Factory


class Server(daphne_server.Server):  # type: ignore[misc]  # Daphne has no types
    """Daphne, which counts who is connected."""

    keeper: pages_process.Keeper | None = None  # of the pages process; None in tests of the server alone

    def __init__(self, *args: Any, **options: Any) -> None:
        from django.conf import settings  # the application was imported before

        super().__init__(*args, **options)
        self.session_cookie = settings.SESSION_COOKIE_NAME.encode()
        self.open: Connections[Any] = Connections()
        self.requests = Places(limits.REQUESTS, limits.REQUESTS_OF_ADDRESS)
        self.websockets = Places(limits.CONNECTIONS, limits.WEBSOCKETS_OF_ADDRESS)
        self.forward: pages_process.Forward | None = None  # None: this process answers all
        self.work = WorkQueue(lambda work: reactor._asyncioEventloop.call_soon(work))
        self.bodies_bytes = 0  # of all requests that arrive, or wait for their answers

    def run(self) -> None:
        """Run until it is asked to end."""
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
        """Priority for the loop; and garbage is collected by it, between commands, never among all of Django."""
        prefer_this_thread()
        garbage = Garbage()
        self._collecting = task.LoopingCall(
            lambda: garbage.collect(time.monotonic(), waits=self.websockets.taken > 0)
        )
        self._collecting.start(GARBAGE_S)

    def create_application(self, protocol: Any, scope: dict[str, Any]) -> Any:
        """Begin the application for a request or a WebSocket."""
        if scope["type"] == "websocket":
            scope["extensions"] = {
                websocket.DIRECT_RECEIVER: protocol.set_direct_receiver,
                websocket.DIRECT_SENDER: protocol.send_directly,
            }
        return super().create_application(protocol, scope)

    def entered(self, connection: channel.Channel) -> bool:
        """Return whether there is a place for a new connection; the oldest that only waits leaves for it."""
        address = getattr(connection.transport.getPeer(), "host", None)
        if self.proxy_forwarded_address_header:
            address = None
        admitted, leaves = self.open.admit(connection.transport, address)
        if leaves is not None:
            leaves.abortConnection()
        return admitted

    def working(self, connection: channel.Channel) -> None:
        """It has sent a whole request."""
        self.open.working(connection.transport)

    def waiting(self, connection: channel.Channel) -> None:
        """Its request was answered."""
        self.open.waiting(connection.transport)

    def is_ours(self, transport: Any) -> bool:
        """Return whether a connection came by the socket that only the pages processes of this account open."""
        keeper = self.keeper
        return keeper is not None and getattr(transport.getHost(), "name", None) == os.fsencode(
            keeper.programs
        )

    def left(self, transport: Any) -> None:
        """It is closed."""
        self.open.left(transport)


class CommandLine(CommandLineInterface):  # type: ignore[misc]
    """Daphne's, with smaller WebSocket messages and a process for the pages."""

    server_class = Server

    def __init__(self) -> None:
        super().__init__()
        self.parser.set_defaults(
            websocket_max_message_size=limits.MESSAGE_BYTES, websocket_max_frame_size=limits.MESSAGE_BYTES
        )

    def run(self, args: list[str]) -> None:
        """Run until it is asked to end."""
        asked: Namespace = self.parser.parse_args(args)
        os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
        from django.conf import settings

        keeper = Server.keeper = pages_process.Keeper(settings.FLEET_RUN_DIR, asked.application)
        try:
            super().run(args)
        finally:
            keeper.end()
            keeper.wait()
