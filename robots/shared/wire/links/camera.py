"""Live pictures of a robot's cameras: messages of a page's camera WebSocket, and of the link to a camera process.

A picture is one binary frame: the length of its header (4 bytes, big-endian), the header (JSON), the encoded picture.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from robots.shared.wire.base import Milliseconds, Ping, Refusal, Seq
from robots.shared.wire.codec import framed, unframed

CameraName = Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[a-z0-9][a-z0-9_-]*\Z")]
CameraRate = Annotated[float, Meta(ge=0.1, le=30.0)]  # Hz
CameraSize = Literal["full", "small"]
Variant = Literal["full", "small", "video"]
PictureFormat = Literal["jpeg", "png", "h264"]

MOST_CAMERAS = 8  # a robot has at most so many


class CameraWatch(Struct, frozen=True, tag_field="t", tag="camera_watch"):
    """Show this camera from now on, or change rate or size. `video`: this client decodes H.264."""

    camera: CameraName
    video: bool = False
    rate_hz: CameraRate = 30.0
    size: CameraSize = "full"


class CameraEnd(Struct, frozen=True, tag_field="t", tag="camera_end"):
    """Stop showing this camera."""

    camera: CameraName


class CameraAck(Struct, frozen=True, tag_field="t", tag="camera_ack"):
    """Picture `number` was painted, or was `damaged`. At most two pictures of a camera wait for this message."""

    camera: CameraName
    number: Seq
    damaged: bool = False


CameraMessage = CameraWatch | CameraEnd | CameraAck | Ping


class CameraEntry(Struct, frozen=True):
    """One camera of the robot. `moves`: the camera is on a head that can be turned."""

    name: str
    label: str
    moves: bool = False


class Cameras(Struct, frozen=True, tag_field="t", tag="cameras"):
    """The robot's cameras: the first message of a connection; sent again when the robot was edited."""

    cameras: list[CameraEntry]


class CameraState(Struct, frozen=True, tag_field="t", tag="camera_state"):
    """State of a camera. `refusal`: the reason why it has no pictures now; None: pictures come.

    `warning`: the reason why nothing can be drawn into its pictures.
    """

    camera: str
    refusal: Refusal | None = None
    warning: Refusal | None = None


class CameraPong(Struct, frozen=True, tag_field="t", tag="camera_pong"):
    """Answer to `Ping`. `now_ms`: the clock of `PictureHeader.taken_ms`."""

    sent_ms: float
    now_ms: float


class PictureScale(Struct, frozen=True):
    """Values of the darkest and the brightest grey of a picture of depth or heat; None: no pixel has a value.

    `unit`: "m" for depth; "": numbers as the sensor sends them.
    """

    low: float | None
    high: float | None
    unit: str = ""


class PictureHeader(Struct, frozen=True):
    """Header of a picture for a page.

    `lens`: focal lengths and centre (fx, fy, cx, cy) in pixels of `width` x `height`. `pose`: 3 x 4 matrix, row by
    row, from the base frame to the optical frame (z into the picture, x right, y down), in metres. None: not known.
    """

    camera: str
    number: int  # grows; an "h264" picture needs all pictures since the last key picture
    format: PictureFormat
    width: int  # of the camera's picture; the encoded picture may be smaller
    height: int
    taken_ms: Milliseconds  # time at which it was taken, by the web process's monotonic clock
    key: bool = True  # it can be decoded without earlier pictures
    lens: tuple[float, float, float, float] | None = None
    pose: tuple[float, ...] | None = None
    scale: PictureScale | None = None  # of depth and heat


# --- between web process and camera process ------------------------------------------------------------


class CameraWants(Struct, frozen=True, tag_field="t", tag="camera_wants"):
    """Pictures that a web process needs: the variants of each camera, with the highest rate (Hz) of each variant."""

    cameras: dict[CameraName, dict[Variant, CameraRate]]


class CameraKey(Struct, frozen=True, tag_field="t", tag="camera_key"):
    """Make the next video picture of this camera a key picture."""

    camera: CameraName


CameraRequest = CameraWants | CameraKey


class TakenPicture(Struct, frozen=True):
    """Header of a picture from the camera process. `age_s`: time from taking to sending it."""

    camera: str
    variant: Variant
    number: int
    format: PictureFormat
    width: int
    height: int
    age_s: float
    key: bool = True
    lens: tuple[float, float, float, float] | None = None
    pose: tuple[float, ...] | None = None
    scale: PictureScale | None = None  # of depth and heat


_taken = msgspec.json.Decoder(TakenPicture)
_shown = msgspec.json.Decoder(PictureHeader)


def packed(header: PictureHeader | TakenPicture, picture: bytes | memoryview) -> bytes:
    """Return one frame with header and encoded picture."""
    return framed(header, picture)


def unpacked(frame: bytes) -> tuple[TakenPicture, memoryview]:
    """Return header and encoded picture of a frame of the camera process. Raises msgspec.DecodeError."""
    header, picture = unframed(frame)
    return _taken.decode(header), picture


def picture_of(frame: bytes) -> tuple[PictureHeader, bytes]:
    """Return header and encoded picture of a frame for a page. Raises msgspec.DecodeError."""
    header, picture = unframed(frame)
    return _shown.decode(header), bytes(picture)
