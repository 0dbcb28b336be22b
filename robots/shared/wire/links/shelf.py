"""Files of recordings on a bridge's computer: messages of the link to a shelf.

A request is one text frame, its answer one binary frame as in `camera`: header and bytes.
"""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

import msgspec
from msgspec import Meta, Struct

from robots.shared.wire.codec import unframed

# The MCAP file, or the small picture beside it
RecordingPart = Literal["file", "thumbnail"]
LARGEST_READ = 1024 * 1024  # bytes


class ShelfRead(Struct, frozen=True, tag_field="t", tag="shelf_read"):
    """Read at most `size` bytes of a recording, from `offset` on."""

    recording: UUID
    part: RecordingPart
    offset: Annotated[int, Meta(ge=0, le=2**60)]
    size: Annotated[int, Meta(ge=0, le=LARGEST_READ)]


class ShelfPart(Struct, frozen=True):
    """Header of the answer. `size`: of the whole file; None: there is no such file, or it cannot be read."""

    size: int | None


_part = msgspec.json.Decoder(ShelfPart)


def unshelved(frame: bytes) -> tuple[ShelfPart, memoryview]:
    """Return header and bytes of a frame. Raises msgspec.DecodeError."""
    header, content = unframed(frame)
    return _part.decode(header), content
