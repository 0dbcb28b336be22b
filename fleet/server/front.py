"""The ASGI application in front of the console: limits of requests and WebSockets, stops, and the way to the pages.

Stops and WebSockets need no place among requests: many requests never block them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Sequence
from ipaddress import IPv4Network, IPv6Network, ip_address
from typing import Any

from fleet.base.web import stop_addresses
from fleet.base.web.network_addresses import network_of
from fleet.server import AT_ONCE, PING, READ_ON, SEND, WRITABLE, limits
from fleet.server.connections import Connections, Places
from fleet.server.credentials import Credential, credentials_of, likely_credentials
from fleet.server.guard import GUARD, Guard
from fleet.server.pages.client import Pages
from fleet.server.turns import Key, Turns, WorkQueue
from fleet.server.websocket import WebSocket

Network = IPv4Network | IPv6Network
STOPPERS, OTHERS = "people who stop robots", "others"  # owners of work


class Front:
    """ASGI application. `pages` answers requests; None: `console` answers all of them."""

    # The application sets these
    rights: Any = None  # who may stop what (`teleop.stop.rights`)
    # Of this process, for a pages process, which has checked the client's permission
    metrics: Callable[[], bytes]

    def __init__(
        self,
        console: Any,
        *,
        session_cookie: str,
        behind_proxy: bool = False,
        proxies: Collection[Network] = (),
    ) -> None:
        self.session_cookie = session_cookie
        self.pages: Pages | None = None
        self.programs = b""  # the path of the socket for pages processes
        self.open: Connections[Guard] = Connections()
        self.requests = Places(limits.REQUESTS, limits.REQUESTS_OF_ADDRESS)
        self.websockets = Places(limits.WEBSOCKETS, limits.WEBSOCKETS_OF_ADDRESS)
        self.strangers = Turns(limits.STRANGERS_AT_ONCE)
        self.work = WorkQueue(lambda work: asyncio.get_running_loop().call_soon(work))
        # Bytes of the bodies of all requests that arrive or wait for their responses. A proxy has one address.
        of_address = limits.BODIES_BYTES if behind_proxy else limits.BODIES_OF_ADDRESS_BYTES
        self.bodies = Places(limits.BODIES_BYTES, of_address)
        self._console = console
        self._behind_proxy = behind_proxy
        self._proxies = proxies

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        guard = GUARD.get()
        guard.begin()
        if scope["type"] == "websocket":
            await self._websocket(guard, scope, receive, send)
            return
        try:
            await self._request(guard, _with_length(scope, guard.body), _with_body(guard.body, receive), send)
        finally:
            guard.over()

    async def _websocket(self, guard: Guard, scope: dict[str, Any], receive: Any, send: Any) -> None:
        address = _address(scope)
        if not self.websockets.take(address):
            guard.abortConnection()
            return
        socket = WebSocket(guard, receive, send)
        extensions = {
            **scope.get("extensions", {}),
            AT_ONCE: socket.receive_at_once,
            SEND: socket.send,
            WRITABLE: guard.writable,
            PING: socket.ping,
            READ_ON: guard.always_read,
        }
        try:
            await self._console({**scope, "extensions": extensions}, socket.receive, socket.send)
        finally:
            self.websockets.give_back(address)

    async def _request(self, guard: Guard, scope: dict[str, Any], receive: Any, send: Any) -> None:
        path = scope["raw_path"]
        if path == b"/metrics" and self._is_own(guard):
            await _send_metrics(send, self.metrics())
        elif self.pages is not None and stop_addresses.is_stop(scope["method"].encode(), path):
            await self._stop(guard, scope, receive, send)
        else:
            await self._in_turn(guard, scope, receive, send)

    async def _stop(self, guard: Guard, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Handle a stop: first find out whose it is. The answers come in turns, like the bytes of requests.

        The stop of a known person is sent from here, with the links, also if its connection has closed meanwhile: it
        needs no reader. All other stops are answered in the pages process.
        """
        address = _address(scope)
        path = scope["raw_path"].decode("latin-1")
        credentials = credentials_of(scope["headers"], self.session_cookie, path)
        right, credential = await self._right(credentials)
        if credentials:
            await self.work.turn(self.owner_of(credential, address))
        if right is not None and right.robots_at(path):
            await self._console({**scope, "extensions": {stop_addresses.RIGHT: right}}, receive, send)
            return
        _end_with(guard)
        async with self.strangers.turn(right.key if right is not None else (address,)):
            await self._answer(guard, scope, receive, send)

    async def _right(self, credentials: Sequence[Credential]) -> tuple[Any, Credential | None]:
        """Return the first right that these credentials give, and the last credential that was looked up.

        A program may send a session that has ended next to its valid token.
        """
        right = credential = None
        for credential in credentials if self.rights is not None else []:
            right = await self.rights.ask(credential)
            if right is not None:
                break
        return right, credential

    async def _in_turn(self, guard: Guard, scope: dict[str, Any], receive: Any, send: Any) -> None:
        address = _address(scope)
        if not self.requests.take(address):
            guard.refuse(limits.busy())
            return
        try:
            _end_with(guard)
            await self._answer(guard, scope, receive, send)
        finally:
            self.requests.give_back(address)

    async def _answer(self, guard: Guard, scope: dict[str, Any], receive: Any, send: Any) -> None:
        if self.pages is None:
            await self._console(scope, receive, send)
        else:
            await self.pages.answer(guard, scope, send, behind_proxy=self._behind_proxy)

    # For guards

    def owner_of(self, credential: Credential | None, address: str) -> Key:
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
        likely = likely_credentials(data, self.session_cookie.encode())
        owners = (self.owner_of(credential, "") for credential in likely)
        return next((owner for owner in owners if owner[0] is STOPPERS), before)

    @staticmethod
    def address_of(transport: Any) -> str:
        """Return the address for which a connection counts; blank: a Unix socket."""
        host = getattr(transport.getPeer(), "host", None)
        return network_of(host) if host else ""

    def serves(self, transport: Any) -> bool:
        """Return whether this connection comes from a proxy, if only proxies may connect, or from this account."""
        host = getattr(transport.getPeer(), "host", None)
        if not (host and self._proxies):
            return True
        address = ip_address(host)
        address = getattr(address, "ipv4_mapped", None) or address
        return any(address in network for network in self._proxies)

    def entered(self, guard: Guard) -> bool:
        """Return whether there is a place for a new connection.

        If necessary, close the oldest waiting connection.
        """
        address = None if self._behind_proxy else self.address_of(guard) or None
        admitted, leaves = self.open.admit(guard, address)
        if leaves is not None:
            leaves.abortConnection()
        return admitted

    def _is_own(self, guard: Guard) -> bool:
        return bool(self.programs) and getattr(guard.getHost(), "name", None) == self.programs


def _end_with(guard: Guard) -> None:
    """Cancel this request when its connection ends."""
    if task := asyncio.current_task():
        guard.when_lost = task.cancel
        if guard.is_lost:
            task.cancel()


async def _send_metrics(send: Any, text: bytes) -> None:
    headers = [(b"content-type", b"text/plain; version=0.0.4; charset=utf-8")]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": text})


def _address(scope: dict[str, Any]) -> str:
    """Return the network of the client, for which its request or WebSocket counts."""
    client = scope.get("client")
    return network_of(str(client[0])) if client else ""


def _with_length(scope: dict[str, Any], body: bytes) -> dict[str, Any]:
    return (
        {**scope, "headers": [*scope["headers"], (b"content-length", b"%d" % len(body))]} if body else scope
    )


def _with_body(body: bytes, receive: Any) -> Any:
    """Return a `receive` that returns the guard's body in place of Daphne's empty one."""
    bodies = [body]

    async def receive_with_body() -> Any:
        event = await receive()
        if event["type"] == "http.request" and bodies:
            event = {**event, "body": bodies.pop()}
        return event

    return receive_with_body
