"""The server and its command line."""

from __future__ import annotations

import os
import resource
import socket
import time
from argparse import Namespace
from collections.abc import Collection
from ipaddress import ip_network
from pathlib import Path
from typing import Any

from daphne import server as daphne_server  # first: it chooses Twisted's reactor
from daphne.cli import CommandLineInterface
from django.apps import apps
from twisted.internet import reactor, task
from twisted.internet.endpoints import serverFromString

from fleet.base.database import schema
from fleet.server import guard, limits
from fleet.server.front import Front, Network
from fleet.server.pages.client import Pages
from fleet.server.pages.process import Keeper
from robots.shared.processes.scheduling import Garbage, ask_for_priority

GARBAGE_S = 0.1  # between two collections, so that each one has only few new objects


class Server(daphne_server.Server):  # type: ignore[misc]  # Daphne has no types
    """Daphne's server behind guards, with `Front` before the application."""

    keeper: Keeper | None = None  # keeps the pages process running; None in tests of the server
    proxies: Collection[Network] = ()  # serve only these; empty: everybody

    def __init__(self, application: Any, **options: Any) -> None:
        from django.conf import settings  # the application was imported before

        self.front = Front(
            application,
            session_cookie=settings.SESSION_COOKIE_NAME,
            behind_proxy=options.get("proxy_forwarded_address_header") is not None,
            proxies=self.proxies,
        )
        super().__init__(self.front, **options, ready_callable=self._listen)
        # Daphne would listen without guards
        self._addresses: list[str] = self.endpoints
        self.endpoints: list[str] = []

    def run(self) -> None:
        _least, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))  # each connection is a file
        if self.keeper is not None:
            if apps.ready:  # an application of the tests has no database
                schema.begin("web process")
            self.front.pages = Pages(self.keeper.path)
            self.front.programs = os.fsencode(self.keeper.programs)
            self.keeper.programs.unlink(missing_ok=True)
            self._addresses.append(_private_socket(self.keeper.programs))
            reactor.addSystemEventTrigger("before", "shutdown", self.keeper.end)
            reactor.callWhenRunning(self._prefer_commands)
        super().run()

    def _listen(self) -> None:
        """Listen, with a guard before each of Daphne's protocols. Daphne is ready to run."""
        self.http_factory.timeOut = None  # guards have the limits of time
        guards = guard.Factory(self.http_factory, self.front)
        for address in self._addresses:
            listening = serverFromString(reactor, address).listen(guards)
            listening.addCallback(self._listens)
            listening.addErrback(self.listen_error)

    def _listens(self, port: Any) -> None:
        """Let the kernel hold many new connections, whoever opened the socket."""
        with socket.socket(fileno=os.dup(port.fileno())) as listening:
            listening.listen(limits.BACKLOG)
        self.listen_success(port)

    def _prefer_commands(self) -> None:
        """Give the loop's thread priority, and collect garbage in the loop between commands.

        The many objects of Django are never searched.
        """
        ask_for_priority()
        garbage = Garbage()
        self._collecting = task.LoopingCall(
            lambda: garbage.collect(time.monotonic(), waits=self.front.websockets.taken > 0)
        )
        self._collecting.start(GARBAGE_S)


def _private_socket(path: Path) -> str:
    """Return the description, for Twisted, of a Unix socket that only this account can use."""
    where = str(path).replace("\\", r"\\").replace(":", r"\:")
    return f"unix:{where}:mode=600:lockfile=0"


class CommandLine(CommandLineInterface):  # type: ignore[misc]
    """Daphne's command line, with smaller WebSocket messages and a process for the pages."""

    server_class = Server

    def __init__(self) -> None:
        super().__init__()
        self.parser.set_defaults(
            websocket_max_message_size=limits.MESSAGE_BYTES,
            websocket_max_frame_size=limits.MESSAGE_BYTES,
            server_name="",  # nobody has to know
        )
        self.parser.add_argument("--proxies", default="", help="serve only these networks")

    def run(self, args: list[str]) -> None:
        asked: Namespace = self.parser.parse_args(args)
        os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
        from django.conf import settings

        Server.proxies = [ip_network(one) for one in filter(None, asked.proxies.split(","))]
        keeper = Server.keeper = Keeper(settings.FLEET_RUN_DIR, asked.application)
        try:
            super().run(args)
        finally:
            keeper.end()
            keeper.wait()
