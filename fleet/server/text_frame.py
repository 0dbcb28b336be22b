"""Read the most frequent frame quickly, one small, complete text message, as browsers send it; write messages.

Autobahn reads all other frames: it applies all rules of the protocol, and answers frames that break them.
"""

from __future__ import annotations

import struct

_WHOLE_TEXT = 0x81  # bits of the first byte: final, none of the reserved ones, type text
_WHOLE_BYTES = 0x82  # the same of type binary
_MASKED = 0x80
_LENGTH_FOLLOWS = 126  # the length is in the next two bytes
_LONG_LENGTH_FOLLOWS = 127  # ... eight bytes
_MASK_BYTES = 4
_MOST_BYTES = 1024  # larger messages are rare and not urgent


def message_frame(message: str | bytes) -> bytes:
    """Return the frame of a message to a client."""
    first, payload = (_WHOLE_TEXT, message.encode()) if isinstance(message, str) else (_WHOLE_BYTES, message)
    length = len(payload)
    if length < _LENGTH_FOLLOWS:
        head = bytes((first, length))
    elif length < 1 << 16:
        head = struct.pack("!BBH", first, _LENGTH_FOLLOWS, length)
    else:
        head = struct.pack("!BBQ", first, _LONG_LENGTH_FOLLOWS, length)
    return head + payload


def small_text_frame(data: bytes) -> bytes | None:
    """Return the text in UTF-8 if `data` is exactly one small masked frame with one text message, else None."""
    if len(data) < 2 + _MASK_BYTES or data[0] != _WHOLE_TEXT or data[1] < _MASKED:
        return None
    length, begin = data[1] - _MASKED, 2
    if length == _LENGTH_FOLLOWS:
        length, begin = int.from_bytes(data[2:4], "big"), 4
        if length < _LENGTH_FOLLOWS:  # the protocol demands the shortest form of a length
            return None
    elif length > _LENGTH_FOLLOWS:
        return None
    if length > _MOST_BYTES or len(data) != begin + _MASK_BYTES + length:
        return None
    mask = data[begin : begin + _MASK_BYTES] * (length // _MASK_BYTES + 1)
    masked = int.from_bytes(data[begin + _MASK_BYTES :], "big")
    plain = (masked ^ int.from_bytes(mask[:length], "big")).to_bytes(length, "big")
    try:
        plain.decode()
    except UnicodeDecodeError:
        return None
    return plain
