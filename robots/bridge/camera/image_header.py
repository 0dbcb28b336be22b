"""Reads format and size of a JPEG or PNG picture from its bytes, without decoding it. Pure."""

from __future__ import annotations

import struct
from typing import NamedTuple

from robots.wire import PictureFormat

LARGEST_SIDE = 4096  # pixels: a browser needs 64 MB to paint such a picture
LARGEST_BYTES = 4 * 1024 * 1024  # of an encoded picture

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_JPEG, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
_FRAME_STARTS = frozenset({0xC0, 0xC1, 0xC2})  # baseline, extended, progressive: browsers decode these
_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
_TRAILING = 1024  # some drivers write a few bytes after the end


class Damaged(Exception):
    """The picture cannot be shown. The text is the reason; it follows "the camera's picture "."""


class ImageHeader(NamedTuple):
    """Format, width and height in pixels."""

    format: PictureFormat
    width: int
    height: int


def read_header(picture: bytes | memoryview) -> ImageHeader:
    """Return format and size. Raises `Damaged` for a picture that must not be sent to a browser."""
    if len(picture) > LARGEST_BYTES:
        raise Damaged(f"has {len(picture)} bytes; at most {LARGEST_BYTES} are shown")
    begin = bytes(picture[: len(_PNG)])
    if begin == _PNG:
        header = _png(picture)
    elif begin[:2] == _JPEG:
        header = _jpeg(picture)
    else:
        raise Damaged("is neither JPEG nor PNG")
    require_size(header.width, header.height)
    return header


def require_size(width: int, height: int) -> None:
    """Raise `Damaged` for a picture without pixels, or with too many."""
    if width < 1 or height < 1:
        raise Damaged("has no pixels")
    if max(width, height) > LARGEST_SIDE:
        raise Damaged(f"has {width} x {height} pixels; at most {LARGEST_SIDE} a side are shown")


def _png(picture: bytes | memoryview) -> ImageHeader:
    if len(picture) < 33 or bytes(picture[12:16]) != b"IHDR":
        raise Damaged("is a damaged PNG")
    if _PNG_END not in bytes(picture[-_TRAILING:]):
        raise Damaged("is cut off")
    width, height = struct.unpack(">II", picture[16:24])
    return ImageHeader("png", width, height)


def _jpeg(picture: bytes | memoryview) -> ImageHeader:
    if _JPEG_END not in bytes(picture[-_TRAILING:]):
        raise Damaged("is cut off")
    at = 2
    while at + 9 < len(picture):
        if picture[at] != 0xFF:
            break
        marker = picture[at + 1]
        if marker == 0xFF:  # padding
            at += 1
        elif marker in _WITHOUT_LENGTH:
            at += 2
        elif marker in _FRAME_STARTS:
            height, width = struct.unpack(">HH", picture[at + 5 : at + 9])
            return ImageHeader("jpeg", width, height)
        else:
            at += 2 + struct.unpack(">H", picture[at + 2 : at + 4])[0]
    raise Damaged("is a damaged JPEG")
