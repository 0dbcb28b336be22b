"""A camera's message as a picture that browsers show: JPEG or PNG of 8 bits.

Pictures that must be decoded are imported here on demand: the process starts faster without.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from robots.bridge.camera.pictures.image_header import JPEG_END, end_of, read_header
from robots.shared.wire import PictureFormat, PictureScale


class Shown(NamedTuple):
    """An encoded picture. Width and height in pixels."""

    encoded: bytes
    format: PictureFormat
    width: int
    height: int
    scale: PictureScale | None = None  # of depth and heat


def compressed_picture(data: bytes, form: str, topic: str) -> Shown:
    """Return the picture of a sensor_msgs/CompressedImage with this format. Raises `Damaged`.

    A JPEG, or a PNG of 8 bits, is not decoded. Bytes count, and the format's words only for depth: drivers write any.
    """
    data = _whole(data)
    if not _is_picture(data):
        from robots.bridge.camera.pictures.deep import depth_png, is_depth_png

        if is_depth_png(data, form):
            return _deep(*depth_png(data, form))
    header = read_header(data)
    if header.deep:
        from robots.bridge.camera.pictures.deep import png_deep

        return _deep(*png_deep(data, is_depth(topic)))
    return Shown(data, header.format, header.width, header.height)


def raw_picture(message: Any, topic: str) -> Shown:
    """Return the picture of a sensor_msgs/Image as JPEG. Raises `Damaged`."""
    from robots.bridge.camera.pictures.deep import is_deep, raw_deep
    from robots.bridge.camera.pictures.image_header import require_size
    from robots.bridge.camera.pictures.jpeg import jpeg, raw_image

    width, height, encoding = message.width, message.height, message.encoding
    require_size(width, height)
    data = bytes(message.data)
    step = message.step or len(data) // height  # some drivers leave it out
    if is_deep(encoding):
        return _deep(
            *raw_deep(width, height, encoding, bool(message.is_bigendian), step, data, is_depth(topic))
        )
    return Shown(jpeg(raw_image(width, height, encoding, step, data)), "jpeg", width, height)


def is_depth(topic: str) -> bool:
    """Return whether a topic's values are lengths: REP 118 gives depth no encoding of its own, so its name decides."""
    return "depth" in topic.lower()


def _deep(image: Any, scale: PictureScale) -> Shown:
    from robots.bridge.camera.pictures.jpeg import jpeg

    return Shown(jpeg(image), "jpeg", image.width, image.height, scale)


def _is_picture(data: bytes) -> bool:
    return data.startswith((b"\xff\xd8", b"\x89PNG"))


def _whole(data: bytes) -> bytes:
    """Return the picture without bytes behind its end; a complete JPEG gets the end that its camera left out."""
    if not _is_picture(data):
        return data
    end = end_of(data)
    if end is not None:
        return data[:end]
    without_padding = data.rstrip(b"\0")
    if data.startswith(b"\xff\xd8"):
        from robots.bridge.camera.pictures.jpeg import is_complete

        if is_complete(without_padding):
            return without_padding + JPEG_END
    return data
