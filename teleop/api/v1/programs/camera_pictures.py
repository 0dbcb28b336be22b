"""One picture of a robot's camera, by the protocol of the page's camera WebSocket."""

from __future__ import annotations

import asyncio
import time

import msgspec
from websockets.exceptions import ConnectionClosed

from robots.link.camera_link import STARTING
from robots.shared import wire
from robots.shared.wire import Cameras, CameraState, CameraWatch, NotDone, PictureHeader, Refusal, Refused
from teleop.api.v1.programs.connection import GONE, ProgramSignIn, open_socket

PICTURE_S = 12.0  # the camera process may have to start

_SILENT = Refusal("camera_silent", "No picture of this camera came within 12 s. Look at the robot.", "robot")
_report = msgspec.json.Decoder(Cameras | CameraState | Refused)


async def one_picture(
    path: str, slug: str, sign_in: ProgramSignIn, watch: CameraWatch
) -> tuple[PictureHeader, bytes]:
    """Return the next picture with its header. The web process checks the right, and records the viewing.

    Raises `NotDone`: no right, no camera, no picture.
    """
    until_s, refusal = time.monotonic() + PICTURE_S, _SILENT
    socket = await open_socket(path, f"/ws/robots/{slug}/camera/", sign_in)
    try:
        await socket.send(wire.encode(watch).decode())
        while True:
            heard = await asyncio.wait_for(socket.recv(), max(0.0, until_s - time.monotonic()))
            if isinstance(heard, bytes):
                return wire.picture_of(heard)
            report = _report.decode(heard)
            if isinstance(report, Refused):
                raise NotDone(report.refusal)
            if isinstance(report, CameraState) and report.refusal is not None:
                if report.refusal.code != STARTING.code:
                    raise NotDone(report.refusal)
                refusal = report.refusal
    except TimeoutError as error:
        raise NotDone(refusal) from error
    except (OSError, ConnectionClosed) as error:
        raise NotDone(GONE) from error
    finally:
        await socket.close()
