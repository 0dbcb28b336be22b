"""Makes the small picture beside a recording from a message of a camera."""

from __future__ import annotations

import struct

from robots.bridge.recorder.ring import Message

WIDTH, QUALITY = 240, 70
LARGEST_BYTES = 16 * 1024 * 1024

_WORD = struct.Struct("<I")


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def word(self) -> int:
        value: int = _WORD.unpack_from(self._data, self._at)[0]
        self._at += 4
        return value

    def bytes(self, size: int | None = None) -> bytes:
        size = self.word() if size is None else size
        self._at += size
        return self._data[self._at - size : self._at]


def thumbnail_of(message: Message) -> bytes | None:
    """Return a small JPEG of a sensor_msgs/CompressedImage or Image; None: it cannot be shown."""
    if len(message.data) > LARGEST_BYTES:
        return None
    # The decoder is loaded only for this: the black box must stay small
    from robots.bridge.camera.pictures.image_header import Damaged
    from robots.bridge.camera.pictures.jpeg import UNDECODABLE, decoded, jpeg, narrowed, raw_image

    read = _Reader(message.data)
    try:
        read.bytes(12)  # number and time
        read.bytes()  # frame
        if message.origin.type == "sensor_msgs/CompressedImage":
            read.bytes()  # format
            image = decoded(read.bytes(), WIDTH)
        elif message.origin.type == "sensor_msgs/Image":
            height, width, encoding = read.word(), read.word(), read.bytes().decode("ascii", "replace")
            read.bytes(1)  # order of bytes
            image = raw_image(width, height, encoding, read.word(), read.bytes())
        else:
            return None
        return jpeg(narrowed(image, WIDTH).convert("RGB"), QUALITY)
    except (Damaged, struct.error, *UNDECODABLE):
        return None
