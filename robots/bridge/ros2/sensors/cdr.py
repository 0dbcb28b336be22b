"""Reads CDR, the form in which messages of ROS 2 travel.

A message that is too short, or in a form that no ROS 2 publishes, raises ValueError.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from robots.shared.texts import NAME, cut

ENCAPSULATION = 4  # bytes before the message; alignment counts from their end
ORDERS = {b"\0\0": ">", b"\0\1": "<"}  # by the first two of them: big-endian or little-endian


class Cdr:
    """Reads a message from its begin."""

    def __init__(self, raw: bytes) -> None:
        order = ORDERS.get(raw[:2])
        if order is None:
            raise ValueError("the message is not in CDR")
        self._raw = memoryview(raw)[ENCAPSULATION:]
        self.order = order
        self._at = 0

    def values(self, form: str, size: int) -> tuple[Any, ...]:
        """Return numbers of `size` bytes each, of this form."""
        self.align(size)
        try:
            found = struct.unpack_from(self.order + form, self._raw, self._at)
        except struct.error as error:
            raise ValueError("the message is too short") from error
        self._at += struct.calcsize(self.order + form)
        return found

    @property
    def at(self) -> int:
        """Return the place of the next value."""
        return self._at

    def align(self, size: int) -> None:
        """Pass the bytes before the next value of this size."""
        self._at += -self._at % size

    def between(self, begin: int) -> bytes:
        """Return the bytes from this place to the next value."""
        return bytes(self._raw[begin : self._at])

    def passes(self, expected: bytes) -> bool:
        """Pass these bytes if they come next; return whether they do."""
        found = self._raw[self._at : self._at + len(expected)] == expected
        self._at += len(expected) if found else 0
        return found

    def number(self, form: str = "I", size: int = 4) -> Any:
        """Return one number; without arguments, a count."""
        return self.values(form, size)[0]

    def data(self, size: int) -> memoryview:
        """Return bytes, which are not copied."""
        found = self._raw[self._at : self._at + size]
        if len(found) < size:
            raise ValueError("the message is too short")
        self._at += size
        return found

    def skip_text(self) -> None:
        """Pass a string; its length includes a zero at its end."""
        length = self.number()
        self._at += length

    def text(self) -> str:
        """Return a string, cut."""
        length = self.number()
        return cut(bytes(self.data(length)[:-1]).decode(errors="replace"), NAME)

    def stamp_s(self) -> float:
        """Return a stamp (s)."""
        seconds, nanoseconds = self.values("iI", 4)
        return float(seconds + nanoseconds / 1e9)

    def header(self) -> tuple[float, str]:
        """Return stamp (s) and frame of a std_msgs/msg/Header."""
        return self.stamp_s(), self.text().lstrip("/")

    def skip_header(self) -> float:
        """Pass a std_msgs/msg/Header; return its stamp (s)."""
        stamp_s = self.stamp_s()
        self.skip_text()
        return stamp_s

    def floats(self) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
        """Return a sequence of 32-bit numbers, which are not copied."""
        count = self.number()
        return np.frombuffer(self._raw, f"{self.order}f4", count, self._at)
