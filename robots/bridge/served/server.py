"""The process's end of the connections of web processes."""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from socket import AF_UNIX
from typing import Generic, TypeVar

import msgspec
from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed

from robots.bridge.server.listening import PING_S, listen, remove_socket
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import ProcessAt, ProcessName, WireError

log = logging.getLogger(__name__)


def socket_path(link_path: str, name: ProcessName) -> str:
    """Return the process's Unix socket, next to the link's."""
    path = Path(link_path)
    return str(path.with_name(f"{path.stem}.{name}.sock"))


class WebProcess(ABC):
    """One connected web process."""

    def __init__(self, socket: ServerConnection) -> None:
        self.socket = socket
        self.news = asyncio.Event()

    @abstractmethod
    def take(self, raw: str | bytes) -> None:
        """Act on a request. Raises WireError."""

    @abstractmethod
    async def send_waiting(self) -> None:
        """Send what waits."""

    async def write(self) -> None:
        """Send while the connection lives. After a fault it ends: the web process connects again."""
        try:
            while True:
                await self.news.wait()
                self.news.clear()
                await self.send_waiting()
        except ConnectionClosed:
            pass
        except Exception:
            log.exception("a web process is cut")
            await self.socket.close()


W = TypeVar("W", bound=WebProcess)


class ProcessServer(ABC, Generic[W]):
    """Accepts web processes. `ping_s`: the longest time that a connection over a network may be silent."""

    ping_s = PING_S

    def __init__(self, name: ProcessName, address: LinkAddress) -> None:
        unix_path = socket_path(address.unix_path, name) if address.unix_path else None
        self._name = name
        self._address = msgspec.structs.replace(address, unix_path=unix_path, port=0)
        self._servers: list[Server] = []
        self.processes: set[W] = set()

    @abstractmethod
    def connected(self, socket: ServerConnection) -> W:
        """Return the web process of a new connection."""

    @abstractmethod
    def left(self) -> None:
        """Note that a web process has left."""

    async def start(self) -> ProcessAt:
        """Start to listen; return the address."""
        self._servers = await listen(self._address, self._serve, self.ping_s)
        sockets = [socket for server in self._servers for socket in server.sockets]
        ports = [socket.getsockname()[1] for socket in sockets if socket.family != AF_UNIX]
        return ProcessAt(self._name, self._address.unix_path, next(iter(ports), None))

    async def close(self) -> None:
        """Close all connections."""
        for server in self._servers:
            server.close()
            await server.wait_closed()
        if self._address.unix_path:
            remove_socket(self._address.unix_path)

    async def _serve(self, socket: ServerConnection) -> None:
        process = self.connected(socket)
        self.processes.add(process)
        writer = asyncio.create_task(process.write())
        try:
            while True:
                process.take(await socket.recv())
        except ConnectionClosed:
            pass
        except WireError as error:
            log.warning("a web process is cut: %s", error)
        finally:
            self.processes.discard(process)
            self.left()
            writer.cancel()
            with suppress(asyncio.CancelledError):
                await writer
