"""The web process's connection to a process beside a bridge (camera process, tap), open while it is needed."""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from contextlib import suppress

import msgspec
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.link.client import BridgeLink
from robots.link.connections import LARGEST, PING_S, open_link
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import ProcessAt, ProcessName, Refusal

log = logging.getLogger(__name__)

RETRY_S = (0.3, 2.0)  # first and longest pause between attempts
CLOSE_S = 0.2


class ProcessLink(ABC):
    """The connection for one robot. If the process starts again, this class connects to its new address.

    `ping_s`: the longest time that it may be silent over a network. `max_size` (bytes) of a message.
    """

    ping_s = PING_S
    max_size = LARGEST

    def __init__(self, link: BridgeLink, name: ProcessName, wants: msgspec.Struct, starting: Refusal) -> None:
        self._link = link
        self._name = name
        self._wants = wants
        self._starting = starting
        self._at = ProcessAt(name)
        self._moved = asyncio.Event()
        self._socket: ClientConnection | None = None
        self._sending: set[asyncio.Task[None]] = set()
        link.need_process(name, self._move)
        self._task = asyncio.create_task(self._keep_connected())

    @abstractmethod
    def received(self, message: str | bytes) -> None:
        """Take a message of the process. Raises msgspec.DecodeError. Must not block."""

    @abstractmethod
    def gone(self, refusal: Refusal) -> None:
        """Note that there is no connection to the process, and why."""

    def close(self) -> None:
        """End the connection, because nobody needs it any more. Does not wait."""
        self._link.leave_process(self._name, self._move)
        self._task.cancel()

    def set_wants(self, wants: msgspec.Struct) -> None:
        """Set what the process sends."""
        self._wants = wants
        self.send(wants)

    def send(self, message: msgspec.Struct) -> None:
        """Send a message, if there is a connection."""
        if self._socket is not None:
            task = asyncio.ensure_future(self._send_now(self._socket, message))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)

    def _move(self, at: ProcessAt) -> None:
        self._at = at
        self._moved.set()

    async def _send_now(self, socket: ClientConnection, message: msgspec.Struct) -> None:
        with suppress(ConnectionClosed):
            await socket.send(wire.encode(message), text=True)

    async def _keep_connected(self) -> None:
        pause_s, longest_s = RETRY_S
        while True:
            address = self._address()
            if address is None:
                self.gone(self._refusal)
                await self._moved.wait()
                self._moved.clear()
                continue
            try:
                async with open_link(address, CLOSE_S, self.ping_s, self.max_size) as socket:
                    pause_s = RETRY_S[0]
                    await self._run(socket)
            except (TimeoutError, OSError, InvalidHandshake, ConnectionClosed, ValueError) as error:
                log.info("the %s process of %s: %s", self._name, self._link.robot_id, error)
            except Exception:  # a fault of who listens must not leave the others without messages
                log.exception("the %s process of %s", self._name, self._link.robot_id)
            self.gone(self._refusal)
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, longest_s)

    @property
    def _refusal(self) -> Refusal:
        """Return why there is no connection. Before the link's first attempt ends, its refusal does not count."""
        return (
            (self._link.refusal if self._link.tried.is_set() else None) or self._at.refusal or self._starting
        )

    def _address(self) -> LinkAddress | None:
        at = self._at
        if at.unix_path is None and at.port is None:
            return None
        return msgspec.structs.replace(self._link.address, unix_path=at.unix_path, port=at.port)

    async def _run(self, socket: ClientConnection) -> None:
        self._socket = socket
        try:
            await socket.send(wire.encode(self._wants), text=True)
            while True:
                self.received(await socket.recv())
        finally:
            self._socket = None
