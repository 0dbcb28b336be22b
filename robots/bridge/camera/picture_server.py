"""Serves pictures to web processes: each gets the newest picture of each variant that it wants, never a queue."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from socket import AF_UNIX
from typing import NamedTuple

import msgspec
from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed

from robots.bridge.camera.camera_client import socket_path
from robots.bridge.server.listening import listen, remove_socket
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import CameraAt, CameraState, TakenPicture, Variant, WireError

log = logging.getLogger(__name__)

Wants = Mapping[str, Mapping[Variant, float]]  # camera -> variant -> highest rate (Hz)


class _Waiting(NamedTuple):
    header: TakenPicture
    encoded: bytes
    arrived_s: float


class _WebProcess:
    """One connected web process."""

    def __init__(self, socket: ServerConnection, require_key: Callable[[str], None]) -> None:
        self.wants: Wants = {}
        self._socket = socket
        self._require_key = require_key
        self._pictures: dict[tuple[str, str], _Waiting] = {}
        self._states: dict[str, CameraState] = {}
        self._broken: set[str] = set()  # cameras whose video lacks a picture until the next key picture
        self._news = asyncio.Event()

    def show(self, header: TakenPicture, encoded: bytes, arrived_s: float) -> None:
        """Send this picture next; it replaces an older one that is not sent yet."""
        if header.variant not in self.wants.get(header.camera, {}):
            return
        if header.variant == "video" and not self._continues(header):
            return
        self._pictures[header.camera, header.variant] = _Waiting(header, encoded, arrived_s)
        self._news.set()

    def _continues(self, header: TakenPicture) -> bool:
        """Return whether viewers of earlier pictures can decode this one. After a gap, request a key picture."""
        if header.key:
            self._broken.discard(header.camera)
        elif (header.camera, "video") in self._pictures or header.camera in self._broken:
            self._pictures.pop((header.camera, "video"), None)
            self._broken.add(header.camera)
            self._require_key(header.camera)
            return False
        return True

    def report(self, state: CameraState) -> None:
        """Send the newest state of a camera."""
        self._states[state.camera] = state
        self._news.set()

    async def write(self) -> None:
        """Send while the connection lives."""
        while True:
            await self._news.wait()
            self._news.clear()
            while self._states:
                await self._socket.send(wire.encode(self._states.pop(next(iter(self._states)))), text=True)
            while self._pictures:
                header, encoded, arrived_s = self._pictures.pop(next(iter(self._pictures)))
                age_s = header.age_s + time.monotonic() - arrived_s
                await self._socket.send(wire.packed(msgspec.structs.replace(header, age_s=age_s), encoded))


class PictureServer:
    """Accepts web processes. `set_wants` gets the combined wants of all of them."""

    def __init__(
        self, address: LinkAddress, set_wants: Callable[[Wants], None], require_key: Callable[[str], None]
    ) -> None:
        unix_path = socket_path(address.unix_path) if address.unix_path else None
        self._address = msgspec.structs.replace(address, unix_path=unix_path, port=0)
        self._set_wants = set_wants
        self._require_key = require_key
        self._processes: set[_WebProcess] = set()
        self._states: dict[str, CameraState] = {}
        self._servers: list[Server] = []

    async def start(self) -> CameraAt:
        """Start to listen; return the address."""
        self._servers = await listen(self._address, self._serve)
        sockets = [socket for server in self._servers for socket in server.sockets]
        ports = [socket.getsockname()[1] for socket in sockets if socket.family != AF_UNIX]
        return CameraAt(self._address.unix_path, next(iter(ports), None))

    async def close(self) -> None:
        """Close all connections."""
        for server in self._servers:
            server.close()
            await server.wait_closed()
        if self._address.unix_path:
            remove_socket(self._address.unix_path)

    def show(self, header: TakenPicture, encoded: bytes, arrived_s: float) -> None:
        """Send a picture to all web processes that want it."""
        for process in self._processes:
            process.show(header, encoded, arrived_s)

    def report(self, state: CameraState) -> None:
        """Send a camera's state to all web processes."""
        self._states[state.camera] = state
        for process in self._processes:
            process.report(state)

    async def _serve(self, socket: ServerConnection) -> None:
        process = _WebProcess(socket, self._require_key)
        self._processes.add(process)
        for state in self._states.values():
            process.report(state)
        writer = asyncio.create_task(process.write())
        try:
            while True:
                match wire.camera_request(await socket.recv()):
                    case wire.CameraWants(cameras=wants):
                        process.wants = wants
                        self._add_up()
                    case wire.CameraKey(camera=camera):
                        self._require_key(camera)
        except ConnectionClosed:
            pass
        except WireError as error:
            log.warning("a web process is cut: %s", error)
        finally:
            self._processes.discard(process)
            self._add_up()
            writer.cancel()
            with suppress(asyncio.CancelledError, ConnectionClosed):
                await writer

    def _add_up(self) -> None:
        wants: dict[str, dict[wire.Variant, float]] = {}
        for process in self._processes:
            for camera, variants in process.wants.items():
                mine = wants.setdefault(camera, {})
                for variant, rate_hz in variants.items():
                    mine[variant] = max(rate_hz, mine.get(variant, 0.0))
        self._states = {camera: state for camera, state in self._states.items() if camera in wants}
        self._set_wants(wants)
