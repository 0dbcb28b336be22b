"""The frame that most often comes: one whole text message, as browsers send it. Pure.

Anything else is for the full parser, which knows all rules and answers what breaks them.
"""

from __future__ import annotations

_WHOLE_TEXT = 0x81  # final, nothing reserved, text
_MASKED = 0x80
_LENGTH_FOLLOWS = 126  # in two bytes
_MASK_BYTES = 4
_MOST_BYTES = 1024  # larger messages are rare, and not in a hurry


def whole_text(data: bytes) -> str | None:
    """The text, if `data` is exactly one small masked frame of one text message; None of everything else."""
    if len(data) < 2 + _MASK_BYTES or data[0] != _WHOLE_TEXT or data[1] < _MASKED:
        return None
    length, begin = data[1] - _MASKED, 2
    if length == _LENGTH_FOLLOWS:
        length, begin = int.from_bytes(data[2:4], "big"), 4
        if length < _LENGTH_FOLLOWS:  # too long a way to say it
            return None
    elif length > _LENGTH_FOLLOWS:
        return None
    if length > _MOST_BYTES or len(data) != begin + _MASK_BYTES + length:
        return None
    mask = data[begin : begin + _MASK_BYTES] * (length // _MASK_BYTES + 1)
    masked = int.from_bytes(data[begin + _MASK_BYTES :], "big")
    plain = (masked ^ int.from_bytes(mask[:length], "big")).to_bytes(length, "big")
    try:
        return plain.decode()
    except UnicodeDecodeError:
        return None
