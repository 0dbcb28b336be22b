"""Pictures of depth, heat and other values of more than eight bits: stretched to grey, with the values of both ends.

The values between two percentiles are stretched, so that a single hot pixel or an echo from far away does not darken
all others. Values that sensors report where they measured nothing (not finite, zero) are black.

Values of depth are known to be lengths: millimetres as integers, metres as floats (REP 118).
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from robots.bridge.camera.pictures.image_header import Damaged, read_header, too_few, undecodable
from robots.shared.sentences import say
from robots.shared.wire import PictureScale

PERCENTILES = (2.0, 98.0)
DARKEST = 24  # grey of the lowest value: black is for pixels without a value
EVEN = 140  # grey of a picture whose values are equal
MOST_SAMPLED = 40_000  # values from which percentiles are taken
LONGEST_M = 65.535  # of a depth in millimetres: sensors write it where there is no echo

# Type and values per pixel of raw encodings; some drivers use OpenCV's names.
_GREY = {"mono16": "u2", "16UC1": "u2", "16SC1": "i2", "32SC1": "i4", "32FC1": "f4", "64FC1": "f8"}
_TYPES = {
    **{name: (kind, 1) for name, kind in _GREY.items()},
    **{f"TYPE_{name}": (kind, 1) for name, kind in _GREY.items()},
    **{f"bayer_{pattern}16": ("u2", 1) for pattern in ("rggb", "bggr", "gbrg", "grbg")},
    **{f"{order}16": ("u2", len(order)) for order in ("rgb", "bgr", "rgba", "bgra")},
    **{f"16UC{count}": ("u2", count) for count in (3, 4)},
}
_BLUE_FIRST = ("bgr", "16UC3", "16UC4")
_DEPTH_HEADER = 12  # bytes before the PNG of compressedDepth: format, two parameters

_Values = NDArray[np.float32]
_Numbers = NDArray[Any]


def is_deep(encoding: str) -> bool:
    """Return whether a raw image of this encoding has more than eight bits a value."""
    return encoding in _TYPES


def raw_deep(
    width: int, height: int, encoding: str, big_endian: bool, step: int, data: bytes, is_depth: bool
) -> tuple[PIL.Image.Image, PictureScale]:
    """Return a raw image in grey (or colour), and its scale. Raises `Damaged` if its bytes do not fit."""
    kind, count = _TYPES[encoding]
    row = width * count * np.dtype(kind).itemsize
    if step < row or len(data) < step * height:
        raise too_few(len(data), width, height, encoding)
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)
    values = np.ascontiguousarray(rows[:, :row]).view((">" if big_endian else "<") + kind)
    if count == 1:
        return stretched(_lengths(values) if is_depth else values, is_depth)
    colours = values.reshape(height, width, count)[:, :, :3]
    return stretched(colours[:, :, ::-1] if encoding.startswith(_BLUE_FIRST) else colours, is_depth=False)


def png_deep(picture: bytes, is_depth: bool) -> tuple[PIL.Image.Image, PictureScale]:
    """Return a PNG of 16 bits in grey (or colour), and its scale. Raises `Damaged`."""
    values = _decoded(picture)
    is_depth = is_depth and values.ndim == 2
    return stretched(_lengths(values) if is_depth else values, is_depth)


def depth_png(data: bytes, form: str) -> tuple[PIL.Image.Image, PictureScale]:
    """Return a picture of the transport compressedDepth in grey, and its scale. Raises `Damaged`.

    Floats are sent as 16 bits of an inverse: depth = a / (value - b), with a and b before the PNG
    (compressed_depth_image_transport, codec.cpp).
    """
    if "rvl" in form.lower():
        raise Damaged(
            say("is compressed by RVL, which the console does not read: set compressedDepth to PNG")
        )
    if len(data) <= _DEPTH_HEADER:
        raise Damaged(say("is cut off"))
    values = _decoded(data[_DEPTH_HEADER:])
    if not form.strip().upper().startswith("32FC1"):
        return stretched(_lengths(values), is_depth=True)
    _, a, b = struct.unpack_from("<iff", data)
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = np.where(values > 0, a / (values.astype(np.float32) - b), np.nan)
    return stretched(metres, is_depth=True)


def is_depth_png(data: bytes, form: str) -> bool:
    """Return whether these bytes, with the format of their message, are of the transport compressedDepth."""
    return "compresseddepth" in form.lower() or data[_DEPTH_HEADER : _DEPTH_HEADER + 4] == b"\x89PNG"


def stretched(values: _Numbers, is_depth: bool) -> tuple[PIL.Image.Image, PictureScale]:
    """Return values (height, width) or colours (height, width, 3) as a picture of 8 bits, and its scale."""
    with np.errstate(over="ignore", invalid="ignore"):
        numbers: _Values = values.astype(np.float32)
    is_valid = np.isfinite(numbers) & ((numbers > 0.0) if is_depth else (numbers != 0.0))
    unit = "m" if is_depth else ""
    valid = numbers[is_valid]
    if not len(valid):
        return PIL.Image.fromarray(np.zeros(numbers.shape, np.uint8)), PictureScale(None, None, unit)
    sampled = valid[:: max(1, len(valid) // MOST_SAMPLED)].astype(np.float64)
    low, high = (float(end) for end in np.percentile(sampled, PERCENTILES))
    grey = np.full(numbers.shape, EVEN, np.float32)
    if high > low:
        shares = (np.clip(numbers, low, high).astype(np.float64) - low) / (high - low)
        grey = (DARKEST + shares * (255 - DARKEST)).astype(np.float32)
    picture = np.where(is_valid, np.rint(grey), 0.0).astype(np.uint8)
    return PIL.Image.fromarray(picture), PictureScale(_short(low), _short(high), unit)


def _lengths(values: _Numbers) -> _Numbers:
    """Return depths in metres."""
    if values.dtype.kind == "f":
        return values
    metres = values.astype(np.float32) * np.float32(0.001)
    return np.where(metres < LONGEST_M, metres, np.nan)


def _decoded(picture: bytes) -> _Numbers:
    """Return grey (height, width) or colours (height, width, 3) of a PNG; Pillow keeps 8 bits of colours."""
    if not read_header(picture).deep:
        raise Damaged(say("is no PNG of 16 bits"))
    import av

    try:
        [frame] = av.VideoCodecContext.create("png", "r").decode(av.Packet(picture))
        if frame.format.name == "ya16be":
            return frame.reformat(format="gray16le").to_ndarray()
        values = frame.to_ndarray()
        return values if values.ndim == 2 else values[:, :, :3]
    except (av.FFmpegError, ValueError) as error:
        raise undecodable(error) from error


def _short(value: float) -> float:
    """Round for people: four digits."""
    return float(f"{value:.4g}")
