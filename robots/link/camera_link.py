"""The web process's connection to a robot's camera process, open while somebody watches through this web process."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import Protocol

import msgspec
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.link.client import BridgeLink
from robots.link.connections import open_link
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import CameraAt, CameraState, CameraWants, Refusal, TakenPicture

log = logging.getLogger(__name__)

RETRY_S = (0.3, 2.0)  # first and longest pause between attempts
CLOSE_S = 0.2

STARTING = Refusal("camera_starts", "The camera starts: wait a moment.", "robot")

_state = msgspec.json.Decoder(CameraState)


class PictureListener(Protocol):
    """Receives pictures. Called on the event loop; must not block."""

    def on_picture(self, header: TakenPicture, encoded: memoryview) -> None:
        """Receive a picture."""

    def on_camera_state(self, state: CameraState) -> None:
        """Receive the state of a camera: pictures come, or why they do not."""

    def on_cameras_gone(self, refusal: Refusal) -> None:
        """Note that there is no connection to the camera process, and why."""


class CameraLink:
    """The connection for one robot. If the camera process starts again, this class connects to its new address."""

    def __init__(self, link: BridgeLink, listener: PictureListener) -> None:
        self._link = link
        self._listener = listener
        self._at = CameraAt()
        self._moved = asyncio.Event()
        self._wants: CameraWants = CameraWants({})
        self._socket: ClientConnection | None = None
        self._sending: set[asyncio.Task[None]] = set()
        link.watch_cameras(self._move)
        self._task = asyncio.create_task(self._keep_connected())

    def close(self) -> None:
        """End the connection, because nobody watches any more. Does not wait."""
        self._link.unwatch_cameras(self._move)
        self._task.cancel()

    def set_wants(self, wants: CameraWants) -> None:
        """Set which pictures come."""
        self._wants = wants
        self._send(wants)

    def require_key(self, camera: str) -> None:
        """Ask for a video picture that can be decoded without earlier ones."""
        self._send(wire.CameraKey(camera))

    def _move(self, at: CameraAt) -> None:
        self._at = at
        self._moved.set()

    def _send(self, message: CameraWants | wire.CameraKey) -> None:
        if self._socket is not None:
            task = asyncio.ensure_future(self._send_now(self._socket, message))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)

    async def _send_now(self, socket: ClientConnection, message: CameraWants | wire.CameraKey) -> None:
        with suppress(ConnectionClosed):
            await socket.send(wire.encode(message), text=True)

    async def _keep_connected(self) -> None:
        pause_s, longest_s = RETRY_S
        while True:
            address = self._address()
            if address is None:
                self._listener.on_cameras_gone(self._refusal)
                await self._moved.wait()
                self._moved.clear()
                continue
            try:
                async with open_link(address, close_timeout=CLOSE_S) as socket:
                    pause_s = RETRY_S[0]
                    await self._run(socket)
            except (TimeoutError, OSError, InvalidHandshake, ConnectionClosed, ValueError) as error:
                log.info("the camera process of %s: %s", self._link.robot_id, error)
            self._listener.on_cameras_gone(self._refusal)
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, longest_s)

    @property
    def _refusal(self) -> Refusal:
        """Return why there are no pictures. Before the link's first attempt ends, its refusal does not count."""
        return (self._link.refusal if self._link.tried.is_set() else None) or self._at.refusal or STARTING

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
                received = await socket.recv()
                if isinstance(received, bytes):
                    self._listener.on_picture(*wire.unpacked(received))
                else:
                    self._listener.on_camera_state(_state.decode(received))
        finally:
            self._socket = None
