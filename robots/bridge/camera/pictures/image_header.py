"""Reads format and size of a JPEG or PNG picture from its bytes, without decoding it. Pure."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import NamedTuple

from robots.shared.sentences import say
from robots.shared.wire import PictureFormat

LARGEST_SIDE = 4096  # pixels: a browser needs 64 MB to paint such a picture
LARGEST_BYTES = 4 * 1024 * 1024  # of an encoded picture

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG, JPEG_END = b"\xff\xd8", b"\xff\xd9"
_FRAME_STARTS = frozenset({0xC0, 0xC1, 0xC2})  # baseline, extended, progressive: browsers decode these
_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
_SCAN = 0xDA
_MARKER = re.compile(rb"\xff[\x01-\xcf\xd8-\xfe]")  # behind the data of a scan
_CHUNK = 12  # bytes of a PNG's chunk beside its content


class Damaged(Exception):
    """The picture cannot be shown. The text is the reason; it follows "the camera's picture "."""


def too_few(count: int, width: int, height: int, encoding: str) -> Damaged:
    """Return the error of data with too few bytes for its size."""
    text = say(
        "has {count} bytes; {width} x {height} {encoding} need more",
        count=count,
        width=width,
        height=height,
        encoding=encoding,
    )
    return Damaged(text)


def undecodable(error: Exception) -> Damaged:
    """Return the error of data that a decoder refused."""
    return Damaged(say("cannot be decoded ({error})", error=str(error)[:100]))


class ImageHeader(NamedTuple):
    """Format, width and height in pixels. `deep`: of 16 bits, of which browsers show the upper 8."""

    format: PictureFormat
    width: int
    height: int
    deep: bool = False


def read_header(picture: bytes | memoryview) -> ImageHeader:
    """Return format and size. Raises `Damaged` for a picture that must not be sent to a browser."""
    if len(picture) > LARGEST_BYTES:
        raise Damaged(
            say("has {bytes} bytes; at most {most} are shown", bytes=len(picture), most=LARGEST_BYTES)
        )
    header = _png(picture) if _is_png(picture) else _jpeg(picture)
    require_size(header.width, header.height)
    return header


def require_size(width: int, height: int) -> None:
    """Raise `Damaged` for a picture without pixels, or with too many."""
    if width < 1 or height < 1:
        raise Damaged(say("has no pixels"))
    if max(width, height) > LARGEST_SIDE:
        raise Damaged(
            say(
                "has {width} x {height} pixels; at most {most} a side are shown",
                width=width,
                height=height,
                most=LARGEST_SIDE,
            )
        )


def end_of(picture: bytes | memoryview) -> int | None:
    """Return the length of the picture by its format: drivers may write more bytes behind it. None: it has no end.

    The end of a JPEG is sought in the data of its scans: a preview within its header has an end of its own.
    """
    return _png_end(picture) if _is_png(picture) else _jpeg_end(picture)


def _is_png(picture: bytes | memoryview) -> bool:
    return bytes(picture[: len(_PNG)]) == _PNG


def _png(picture: bytes | memoryview) -> ImageHeader:
    if len(picture) < 33 or bytes(picture[12:16]) != b"IHDR":
        raise Damaged(say("is a damaged PNG"))
    if _png_end(picture) is None:
        raise Damaged(say("is cut off"))
    width, height, bits = struct.unpack(">IIB", picture[16:25])
    return ImageHeader("png", width, height, deep=bits == 16)


def _png_end(picture: bytes | memoryview) -> int | None:
    at = len(_PNG)
    while at + _CHUNK <= len(picture):
        length, kind = struct.unpack(">I4s", picture[at : at + 8])
        at += _CHUNK + length
        if kind == b"IEND":
            return at if at <= len(picture) else None
    return None


def _jpeg(picture: bytes | memoryview) -> ImageHeader:
    if bytes(picture[:2]) != _JPEG:
        raise Damaged(say("is neither JPEG nor PNG"))
    for marker, at in _segments(picture):
        if marker in _FRAME_STARTS and at + 9 < len(picture):
            if _jpeg_end(picture) is None:
                raise Damaged(say("is cut off"))
            height, width = struct.unpack(">HH", picture[at + 5 : at + 9])
            return ImageHeader("jpeg", width, height)
    raise Damaged(say("is a damaged JPEG"))


def _jpeg_end(picture: bytes | memoryview) -> int | None:
    for marker, at in _segments(picture):
        if marker == JPEG_END[1]:
            return at + 2
    return None


def _segments(picture: bytes | memoryview) -> Iterator[tuple[int, int]]:
    """Yield marker and place of each segment, as far as there are whole ones; the data of scans is passed over."""
    at = 2
    while at + 1 < len(picture) and picture[at] == 0xFF:  # every marker begins with it
        marker = picture[at + 1]
        if marker == 0xFF:  # padding
            at += 1
            continue
        yield marker, at
        if marker in _WITHOUT_LENGTH:
            at += 2
        elif marker == JPEG_END[1] or at + 4 > len(picture):
            return
        else:
            at += 2 + int.from_bytes(picture[at + 2 : at + 4], "big")
            if marker == _SCAN:
                following = _MARKER.search(picture, at)
                if following is None:
                    return
                at = following.start()
