"""Connects a web process to a bridge: over a Unix socket, or over TCP with TLS and the shared secret."""

from __future__ import annotations

import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import lru_cache
from pathlib import Path
from socket import gaierror, gethostname
from typing import Any

from msgspec import structs
from websockets.asyncio.client import ClientConnection, connect, unix_connect
from websockets.exceptions import ConnectionClosed
from websockets.sync import client as sync_client

from robots.link.authority import authority_pem
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.processes import last_words
from robots.shared.processes.one_supervisor import LOCK, supervised
from robots.shared.sentences import catalogued, say
from robots.shared.wire import NotDone, Refusal

PING_S = 1.0
_CLOSE_S = 0.2
# Far above the largest real report, because a larger message would close the link, also for stops.
LARGEST = 8 * 1024 * 1024
_COMMON_OPTIONS: dict[str, Any] = {"compression": None, "open_timeout": 2.0, "max_size": LARGEST}

_DOWN = Refusal("bridge_down", "The robot’s bridge is not running; staff can start it.", "robot")
_UNSUPERVISED = catalogued(
    "No supervisor runs on this computer ({computer}): staff can start it. If the robot’s bridge runs on another "
    "computer, staff must enter its bridge address (Admin, Robots)."
)
_DOWN_ELSEWHERE = Refusal(
    "bridge_down",
    "Nothing answers at the address of the robot’s bridge, on another computer: start the bridge there.",
    "robot",
)


class LinkRefused(NotDone):
    """The bridge refused, or cannot be reached."""


@asynccontextmanager
async def open_link(
    address: LinkAddress,
    close_timeout: float | None = 10.0,
    ping_s: float = PING_S,
    max_size: int = LARGEST,
) -> AsyncIterator[ClientConnection]:
    """Context: a lasting connection, by the Unix socket if the bridge is on this computer.

    `close_timeout`: how long (s) its end may wait for the other side. `ping_s`: the longest time that a connection
    over the network may be silent. `max_size` (bytes) of a message.
    """
    socket = await _opened(address, close_timeout, ping_s, max_size)
    try:
        yield socket
    finally:
        await socket.close()


async def _opened(
    address: LinkAddress, close_timeout: float | None, ping_s: float, max_size: int
) -> ClientConnection:
    options = _COMMON_OPTIONS | {"close_timeout": close_timeout, "max_size": max_size}
    if address.unix_path:
        with suppress(*_not_here(address)):
            return await unix_connect(address.unix_path, ping_interval=None, **options)
    return await connect(
        _uri(address),
        ssl=_tls(address),
        additional_headers=_headers(address),
        ping_interval=ping_s,
        ping_timeout=ping_s,
        **options,
    )


def open_sync(address: LinkAddress) -> sync_client.ClientConnection:
    """Open a connection for code without an event loop."""
    if address.unix_path:
        with suppress(*_not_here(address)):
            near: sync_client.ClientConnection = sync_client.unix_connect(
                address.unix_path, close_timeout=_CLOSE_S, ping_interval=None, **_COMMON_OPTIONS
            )
            return near
    connection: sync_client.ClientConnection = sync_client.connect(
        _uri(address),
        ssl=_tls(address),
        additional_headers=_headers(address),
        close_timeout=_CLOSE_S,
        **_COMMON_OPTIONS,
    )
    return connection


def _not_here(address: LinkAddress) -> tuple[type[OSError], ...]:
    """Return the errors after which the bridge is sought on the network: nothing listens on this computer."""
    return (FileNotFoundError, ConnectionRefusedError) if address.host else ()


def _uri(address: LinkAddress) -> str:
    return f"wss://{address.host}:{address.port}/"


def _headers(address: LinkAddress) -> dict[str, str]:
    return {"Authorization": f"Bearer {address.secret}"} if address.secret else {}


def _tls(address: LinkAddress) -> ssl.SSLContext:
    """Return a context that trusts FLEET_LINK_CA; without it the console's link authority and the system's."""
    if address.authority is None:
        return _trusting(None, authority_pem())
    return _trusting(address.authority, Path(address.authority).stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _trusting(authority: str | None, version: str | int) -> ssl.SSLContext:
    """Return a context, which takes 20 ms of a processor to make. `version` differs if the authority does."""
    context = ssl.create_default_context(cafile=authority)
    if isinstance(version, str):
        context.load_verify_locations(cadata=version)
    return context


def down(address: LinkAddress) -> Refusal:
    """Return the refusal while no bridge runs at this address, with the reason if this computer knows it."""
    if not address.unix_path:
        return _DOWN_ELSEWHERE
    if why := last_words.read(address.unix_path, last_words.WHY):
        return structs.replace(_DOWN, text=say("The robot’s bridge is not running: {why}", why=why))
    if address.host:
        return _DOWN_ELSEWHERE
    if supervised(Path(address.unix_path).with_name(LOCK)):
        return _DOWN
    return structs.replace(_DOWN, text=say(_UNSUPERVISED, computer=gethostname()))


def why_down(error: Exception, address: LinkAddress) -> Refusal:
    """Return the refusal that tells people why there is no connection."""
    if isinstance(error, FileNotFoundError | ConnectionRefusedError | ConnectionClosed):
        return down(address)
    if isinstance(error, gaierror):
        return Refusal(
            "bridge_unresolvable",
            say("The name of the bridge’s host cannot be resolved ({error}).", error=error),
            "robot",
        )
    return Refusal(
        "bridge_unreachable", say("The robot’s bridge cannot be reached ({error}).", error=error), "robot"
    )
