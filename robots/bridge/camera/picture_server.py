"""Serves pictures to web processes: each gets the newest picture of each variant that it wants, never a queue."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import msgspec
from websockets.asyncio.server import ServerConnection

from robots.bridge.served.server import ProcessServer, WebProcess
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import CameraState, TakenPicture, Variant

Wants = Mapping[str, Mapping[Variant, float]]  # camera -> variant -> highest rate (Hz)


class _Waiting(NamedTuple):
    header: TakenPicture
    encoded: bytes
    arrived_s: float


class _Viewers(WebProcess):
    """The viewers in one web process."""

    def __init__(
        self, socket: ServerConnection, changed: Callable[[], None], require_key: Callable[[str], None]
    ) -> None:
        super().__init__(socket)
        self.wants: Wants = {}
        self._changed = changed
        self._require_key = require_key
        self._pictures: dict[tuple[str, str], _Waiting] = {}
        self._states: dict[str, CameraState] = {}
        self._broken: set[str] = set()  # cameras whose video lacks a picture until the next key picture

    def take(self, raw: str | bytes) -> None:
        match wire.camera_request(raw):
            case wire.CameraWants(cameras=wants):
                self.wants = wants
                self._changed()
            case wire.CameraKey(camera=camera):
                self._require_key(camera)

    def show(self, header: TakenPicture, encoded: bytes, arrived_s: float) -> None:
        """Send this picture next; it replaces an older one that is not sent yet."""
        if header.variant not in self.wants.get(header.camera, {}):
            return
        if header.variant == "video" and not self._continues(header):
            return
        self._pictures[header.camera, header.variant] = _Waiting(header, encoded, arrived_s)
        self.news.set()

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
        self.news.set()

    async def send_waiting(self) -> None:
        while self._states:
            await self.socket.send(wire.encode(self._states.pop(next(iter(self._states)))), text=True)
        while self._pictures:
            header, encoded, arrived_s = self._pictures.pop(next(iter(self._pictures)))
            age_s = header.age_s + time.monotonic() - arrived_s
            await self.socket.send(wire.packed(msgspec.structs.replace(header, age_s=age_s), encoded))


class PictureServer(ProcessServer[_Viewers]):
    """Accepts web processes. `set_wants` gets the combined wants of all of them."""

    def __init__(
        self, address: LinkAddress, set_wants: Callable[[Wants], None], require_key: Callable[[str], None]
    ) -> None:
        super().__init__("camera", address)
        self._set_wants = set_wants
        self._require_key = require_key
        self._states: dict[str, CameraState] = {}

    def connected(self, socket: ServerConnection) -> _Viewers:
        viewers = _Viewers(socket, self._add_up, self._require_key)
        for state in self._states.values():
            viewers.report(state)
        return viewers

    def left(self) -> None:
        self._add_up()

    def show(self, header: TakenPicture, encoded: bytes, arrived_s: float) -> None:
        """Send a picture to all web processes that want it."""
        for process in self.processes:
            process.show(header, encoded, arrived_s)

    def report(self, state: CameraState) -> None:
        """Send a camera's state to all web processes."""
        self._states[state.camera] = state
        for process in self.processes:
            process.report(state)

    def _add_up(self) -> None:
        wants: dict[str, dict[wire.Variant, float]] = {}
        for process in self.processes:
            for camera, variants in process.wants.items():
                mine = wants.setdefault(camera, {})
                for variant, rate_hz in variants.items():
                    mine[variant] = max(rate_hz, mine.get(variant, 0.0))
        self._states = {camera: state for camera, state in self._states.items() if camera in wants}
        self._set_wants(wants)
