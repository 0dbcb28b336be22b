"""Encodes pictures as compressed or raw bytes, and damages them like a broken camera."""

from __future__ import annotations

import io
import struct
import zlib
from functools import cache
from typing import NamedTuple

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from robots.simulator.faults import Faults

HUGE = 20_000  # declared pixels along each side
_JPEG_QUALITY = 80
_START_OF_FRAME = b"\xff\xc0"


class Encoded(NamedTuple):
    """A compressed picture; `format` is "jpeg" or "png"."""

    format: str
    data: bytes


class Raw(NamedTuple):
    """An uncompressed picture. `step`: bytes of a row."""

    encoding: str
    width: int
    height: int
    step: int
    data: bytes


def compressed(pixels: NDArray[np.uint8], number: int, faults: Faults) -> Encoded:
    """Return picture `number` compressed, and damaged as the faults demand."""
    if faults.camera_bomb:
        return Encoded("png", _bomb())
    if faults.camera_zero:
        return Encoded("jpeg", b"")
    picture = _encoded(pixels, "png" if faults.camera_encoding_changes and number % 2 else "jpeg")
    if faults.camera_huge:
        return Encoded("jpeg", _declared_huge(picture.data))
    if faults.camera_corrupt:
        return picture._replace(data=_overwritten(picture.data, number))
    if faults.camera_truncated:
        return picture._replace(data=picture.data[: len(picture.data) // 2])
    return picture


def raw(pixels: NDArray[np.uint8], number: int, faults: Faults) -> Raw:
    """Return picture `number` uncompressed, and damaged as the faults demand."""
    height, width, _ = pixels.shape
    if faults.camera_zero:
        return Raw("rgb8", 0, 0, 0, b"")
    encoding = ("rgb8", "bgr8", "mono8")[number % 3 if faults.camera_encoding_changes else 0]
    ordered = {"rgb8": pixels, "bgr8": pixels[..., ::-1], "mono8": pixels[..., 1]}[encoding]
    data = ordered.tobytes()
    picture = Raw(encoding, width, height, len(data) // height, data)
    if faults.camera_huge or faults.camera_bomb:
        return picture._replace(width=HUGE, height=HUGE, step=3 * HUGE)
    if faults.camera_corrupt:
        return picture._replace(step=7)
    if faults.camera_truncated:
        return picture._replace(data=data[: len(data) // 2])
    return picture


def _encoded(pixels: NDArray[np.uint8], kind: str) -> Encoded:
    written = io.BytesIO()
    PIL.Image.fromarray(pixels).save(written, kind, quality=_JPEG_QUALITY)
    return Encoded(kind, written.getvalue())


def _declared_huge(jpeg: bytes) -> bytes:
    """Return a JPEG whose header declares 20,000 x 20,000 pixels."""
    size = jpeg.index(_START_OF_FRAME) + 5  # after marker, length and precision
    return jpeg[:size] + struct.pack(">HH", HUGE, HUGE) + jpeg[size + 4 :]


def _overwritten(data: bytes, number: int) -> bytes:
    """Replace the bytes between header and end by random bytes: only a decoder notices that."""
    head = data.index(_START_OF_FRAME) + 40 if _START_OF_FRAME in data else 40
    return data[:head] + np.random.default_rng(number).bytes(len(data) - head - 12) + data[-12:]


@cache
def _bomb() -> bytes:
    """Return a valid PNG of 400 kB that needs 400 MB when decoded: 20,000 x 20,000 grey pixels, all black."""
    packer = zlib.compressobj(9)
    row = bytes(1 + HUGE)
    packed = b"".join(packer.compress(row) for _ in range(HUGE)) + packer.flush()
    head = struct.pack(">IIBBBBB", HUGE, HUGE, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", packed), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )
