"""How ROS 1 and ROS 2 (CDR) serialize messages. Pure.

Both write little-endian numbers in the order of the fields, a length of four bytes before texts and arrays without a
fixed length, and nothing between the fields. CDR also begins with four bytes, lets each number begin at a multiple of
its width, ends a text by a zero, and has one byte for a message without fields.

Source: OMG DDSI-RTPS 2.3, chapter 10 (the header), CORBA 3.3 part 2, 9.3 (CDR), rosidl (messages without fields).
"""

from __future__ import annotations

from typing import NamedTuple


class Serialization(NamedTuple):
    """How the bytes of a message are written."""

    head: bytes  # before the first field
    aligned: bool  # each number begins at a multiple of its width, counted from the first field
    text_end: bytes  # of each text; its length counts it
    nothing: int  # bytes of a message without fields
    exact: bool  # nothing may follow the last field: Fast DDS reserves more bytes than it writes

    def step_of(self, width: int) -> int:
        """Return the bytes of whose multiples a number of this width begins at one."""
        return width if self.aligned else 1

    def gap(self, at: int, step: int) -> int:
        """Return how many bytes before `at` + the gap are empty, if a number with this step comes next."""
        return (len(self.head) - at) % step


ROS1 = Serialization(head=b"", aligned=False, text_end=b"", nothing=0, exact=True)
CDR = Serialization(head=b"\0\1\0\0", aligned=True, text_end=b"\0", nothing=1, exact=False)
