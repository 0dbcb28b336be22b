"""Makes the small picture beside a recording from a message of a camera."""

from __future__ import annotations

import struct

from robots.bridge.recorder.black_box.ring import Message
from robots.shared.messages.type_names import bare

WIDTH, QUALITY = 240, 70
LARGEST_BYTES = 16 * 1024 * 1024

_WORD = struct.Struct("<I")


class _Reader:
    def __init__(self, data: bytes, aligned: bool) -> None:
        self._data = data
        self._at = 0
        self._aligned = aligned  # as in ROS 2

    def word(self) -> int:
        self._at += -self._at % _WORD.size if self._aligned else 0
        value: int = _WORD.unpack_from(self._data, self._at)[0]
        self._at += 4
        return value

    def bytes(self, size: int | None = None) -> bytes:
        size = self.word() if size is None else size
        self._at += size
        return self._data[self._at - size : self._at]

    def text(self) -> str:
        return self.bytes().rstrip(b"\0").decode("ascii", "replace")


def thumbnail_of(message: Message) -> bytes | None:
    """Return a small JPEG of a sensor_msgs/CompressedImage or Image; None: it cannot be shown."""
    if len(message.data) > LARGEST_BYTES:
        return None
    # The decoder is loaded only for this: the black box must stay small
    from robots.bridge.camera.pictures.image_header import Damaged
    from robots.bridge.camera.pictures.jpeg import UNDECODABLE, decoded, jpeg, narrowed, raw_image

    kind, read = bare(message.origin.type), _Reader(message.data, message.origin.encoding == "cdr")
    try:
        read.bytes(12)  # number and time; in ROS 2 what is before each message, and time
        read.bytes()  # frame
        if kind == "sensor_msgs/CompressedImage":
            read.bytes()  # format
            image = decoded(read.bytes(), WIDTH)
        elif kind == "sensor_msgs/Image":
            height, width, encoding = read.word(), read.word(), read.text()
            read.bytes(1)  # order of bytes
            image = raw_image(width, height, encoding, read.word(), read.bytes())
        else:
            return None
        return jpeg(narrowed(image, WIDTH).convert("RGB"), QUALITY)
    except (Damaged, struct.error, *UNDECODABLE):
        return None
