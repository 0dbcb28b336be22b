"""Encodes pictures: raw images to JPEG, and JPEG to smaller JPEG.

The camera process imports this module when it must decode or encode for the first time, and PyAV only for
packed colours. A JPEG that is passed on unchanged needs neither, so its first viewer does not wait for these
imports.
"""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import PIL.Image

from robots.bridge.camera.pictures.encoding import QUALITY, SMALL_QUALITY, SMALL_WIDTH
from robots.bridge.camera.pictures.image_header import (
    JPEG_END,
    LARGEST_SIDE,
    Damaged,
    require_size,
    too_few,
    undecodable,
)
from robots.shared.sentences import say

PIL.Image.MAX_IMAGE_PIXELS = LARGEST_SIDE * LARGEST_SIDE  # Pillow refuses to decode more than twice as many

# Pillow's exceptions for damaged pictures.
UNDECODABLE = (
    *(OSError, ValueError, SyntaxError, EOFError, OverflowError, MemoryError),
    *(struct.error, zlib.error, PIL.Image.DecompressionBombError),
)

# Bytes per pixel and raw mode of Pillow, by encoding of sensor_msgs/Image; OpenCV's names as RViz reads them.
_RAW_MODES = {
    "rgb8": (3, "RGB", "RGB"),
    "bgr8": (3, "RGB", "BGR"),
    "rgba8": (4, "RGB", "RGBX"),
    "bgra8": (4, "RGB", "BGRX"),
    "8UC3": (3, "RGB", "BGR"),
    "8SC3": (3, "RGB", "BGR"),
    "8UC4": (4, "RGB", "BGRX"),
    "8SC4": (4, "RGB", "BGRX"),
    "mono8": (1, "L", "L"),
    "8UC1": (1, "L", "L"),
    "8SC1": (1, "L", "L"),
    "bayer_rggb8": (1, "L", "L"),
    "bayer_bggr8": (1, "L", "L"),
    "bayer_gbrg8": (1, "L", "L"),
    "bayer_grbg8": (1, "L", "L"),
}
_FILLING = bytes(range(1, 250)) * 20  # data as in a picture
_PACKED = {"yuv422": (1, 0), "yuv422_yuy2": (0, 1)}  # the positions of luma and colour in two bytes


def raw_image(width: int, height: int, encoding: str, step: int, data: bytes) -> PIL.Image.Image:
    """Return the picture of a sensor_msgs/Image of 8 bits. Raises `Damaged` if it does not fit or is unknown.

    Bayer patterns are shown as grey: people can drive by such a picture, and no colour is guessed.
    """
    require_size(width, height)
    per_pixel = _bytes_per_pixel(encoding)
    if step < width * per_pixel or len(data) < step * height:
        raise too_few(len(data), width, height, encoding)
    if encoding in _PACKED:
        return _colour_of_packed(width, height, encoding, step, data)
    _, mode, raw_mode = _RAW_MODES[encoding]
    return PIL.Image.frombuffer(mode, (width, height), data, "raw", raw_mode, step, 1)


def _bytes_per_pixel(encoding: str) -> int:
    if encoding in _PACKED:
        return 2
    if encoding not in _RAW_MODES:
        raise Damaged(
            say(
                "has the encoding {encoding}, which the console does not know",
                encoding=repr(encoding[:40]),
            )
        )
    return _RAW_MODES[encoding][0]


def _colour_of_packed(width: int, height: int, encoding: str, step: int, data: bytes) -> PIL.Image.Image:
    if width % 2 or height % 2:
        raise Damaged(
            say(
                "has an odd side of {width} x {height} pixels in {encoding}",
                width=width,
                height=height,
                encoding=encoding,
            )
        )
    pixels = np.frombuffer(data, np.uint8, step * height).reshape(height, step)
    import av

    packed = pixels[:, : 2 * width].reshape(height, width, 2)[:, :, _PACKED[encoding]]
    colours = av.VideoFrame.from_ndarray(np.ascontiguousarray(packed), format="yuyv422").to_ndarray(
        format="rgb24"
    )
    return PIL.Image.fromarray(colours)


def jpeg(image: PIL.Image.Image, quality: int = QUALITY) -> bytes:
    """Return the image as JPEG."""
    written = io.BytesIO()
    image.save(written, "JPEG", quality=quality)
    return written.getvalue()


def decoded(picture: bytes, at_least: int) -> PIL.Image.Image:
    """Decode a JPEG or PNG in RGB. Raises `Damaged`.

    Decode at reduced size where the format allows it, but at least `at_least` pixels wide.
    """
    try:
        image = PIL.Image.open(io.BytesIO(picture), formats=("JPEG", "PNG"))
        image.draft("RGB", (at_least, at_least))
        return image.convert("RGB")
    except UNDECODABLE as error:
        raise undecodable(error) from error


def is_complete(picture: bytes) -> bool:
    """Return whether a JPEG without an end has all its data: some cameras do not write the end.

    A decoder reads a complete picture alike whatever follows; of a cut one, what follows becomes part of it.
    """
    try:
        endings = (picture + filling + JPEG_END for filling in (b"", _FILLING))
        shown, also = (PIL.Image.open(io.BytesIO(one), formats=("JPEG",)).tobytes() for one in endings)
    except UNDECODABLE:
        return False
    return shown == also


def small(image: PIL.Image.Image) -> bytes:
    """Return a small JPEG of the image."""
    return jpeg(narrowed(image, SMALL_WIDTH), SMALL_QUALITY)


def narrowed(image: PIL.Image.Image, width: int) -> PIL.Image.Image:
    """Return the image with even sides, reduced to at most `width` pixels across."""
    scale = min(1.0, width / image.width)
    size = (max(2, round(image.width * scale / 2) * 2), max(2, round(image.height * scale / 2) * 2))
    return image if image.size == size else image.resize(size, PIL.Image.Resampling.BILINEAR)
