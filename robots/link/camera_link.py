"""The web process's connection to a robot's camera process, open while somebody watches through this web process."""

from __future__ import annotations

from typing import Protocol

import msgspec

from robots.link.client import BridgeLink
from robots.link.process_link import ProcessLink
from robots.shared import wire
from robots.shared.wire import CameraState, CameraWants, Refusal, TakenPicture

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


class CameraLink(ProcessLink):
    """The connection for one robot."""

    def __init__(self, link: BridgeLink, listener: PictureListener) -> None:
        self._listener = listener
        super().__init__(link, "camera", CameraWants({}), STARTING)

    def require_key(self, camera: str) -> None:
        """Ask for a video picture that can be decoded without earlier ones."""
        self.send(wire.CameraKey(camera))

    def received(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self._listener.on_picture(*wire.unpacked(message))
        else:
            self._listener.on_camera_state(_state.decode(message))

    def gone(self, refusal: Refusal) -> None:
        self._listener.on_cameras_gone(refusal)
