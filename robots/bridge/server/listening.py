"""WebSocket servers of a robot's processes: a Unix socket for its owner, and TCP with TLS and the shared secret."""

from __future__ import annotations

import hmac
import http
import logging
import os
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from socket import AF_UNIX
from typing import TYPE_CHECKING

from websockets.asyncio.server import Server, ServerConnection, serve, unix_serve
from websockets.http11 import Request, Response

from robots.shared.configuration.bridge_config import LinkAddress

if TYPE_CHECKING:
    import ssl

log = logging.getLogger(__name__)

PING_S = 1.0  # TCP only: a cut cable closes no connection


Serve = Callable[[ServerConnection], Awaitable[None]]  # runs for each connection until it returns


async def listen(address: LinkAddress, serve_connection: Serve, ping_s: float = PING_S) -> list[Server]:
    """Listen on the Unix socket, and on host and port if the address has them.

    `ping_s`: the longest time that a connection over the network may be silent.
    """
    servers = [await _listen_here(address.unix_path, serve_connection)] if address.unix_path else []
    if address.host:
        servers.append(await _listen_on_network(address, serve_connection, ping_s))
    return servers


def is_here(socket: ServerConnection) -> bool:
    """Return whether the other end is on this computer."""
    return bool(socket.transport.get_extra_info("socket").family == AF_UNIX)


async def _listen_here(path: str, serve_connection: Serve) -> Server:
    # The lock of the state file guarantees that no other bridge of this robot runs.
    prepare_socket_path(path)
    umask = os.umask(0o177)
    try:
        return await unix_serve(serve_connection, path, compression=None, ping_interval=None)
    finally:
        os.umask(umask)


async def _listen_on_network(address: LinkAddress, serve_connection: Serve, ping_s: float) -> Server:
    return await serve(
        serve_connection,
        address.host,
        address.port,
        ssl=_tls(address),
        process_request=partial(_check_secret, address),
        compression=None,
        ping_interval=ping_s,
        ping_timeout=ping_s,
    )


def prepare_socket_path(path: str) -> None:
    """Create the socket's folder for its owner only, and remove an old socket."""
    Path(path).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    remove_socket(path)


def remove_socket(path: str) -> None:
    """Remove the socket, if it exists."""
    Path(path).unlink(missing_ok=True)


def _check_secret(address: LinkAddress, socket: ServerConnection, request: Request) -> Response | None:
    expected = f"Bearer {address.secret}"
    given = request.headers.get("Authorization", "")
    if address.secret and hmac.compare_digest(given.encode(), expected.encode()):
        return None
    log.warning("a link without the shared secret was refused")
    return socket.respond(http.HTTPStatus.UNAUTHORIZED, "The shared secret is missing or wrong.\n")


def _tls(address: LinkAddress) -> ssl.SSLContext:
    """Return a context for TLS 1.2 or newer with our certificate. A TCP link needs certificate and secret."""
    if not (address.certificate and address.private_key and address.secret):
        raise ValueError("a TCP link needs a certificate, a private key and a shared secret")
    import ssl  # left out of bridges without a network address

    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    # Openings from threads hung while session tickets were sent (1 of 300), and not without (0 of 2,500)
    context.num_tickets = 0
    context.load_cert_chain(address.certificate, address.private_key)
    return context
