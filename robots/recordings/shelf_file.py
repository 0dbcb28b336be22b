"""A file of a recording on a bridge's computer, read through the shelf there."""

from __future__ import annotations

import logging
import os
import time
from contextlib import suppress
from io import BufferedReader, RawIOBase
from typing import TYPE_CHECKING
from uuid import UUID

from msgspec import DecodeError
from websockets.exceptions import ConnectionClosed

from robots.link.connections import LinkRefused
from robots.link.shelf_link import ShelfLink
from robots.recordings.away import FileAway
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import LARGEST_READ, RecordingPart, Refusal, ShelfPart, ShelfRead

if TYPE_CHECKING:
    from typing import BinaryIO

    from _typeshed import WriteableBuffer

log = logging.getLogger(__name__)

LEAST_AHEAD = 64 * 1024  # bytes of one read. While reads follow one another, each is twice as long
SLOW_S = 1.0
AGAIN_S = 5.0  # until a computer is asked again that did not answer within `SLOW_S`: each question occupies a thread

_HOST_AWAY = Refusal(
    "recording_away",
    "The computer that keeps this recording does not answer: it, or the robot’s bridge there, is off or out of reach. "
    "Try again later.",
    "robot",
)
_silent_until_s: dict[UUID, float] = {}  # by robot


def open_on_shelf(robot_id: UUID, address: LinkAddress, recording: UUID, part: RecordingPart) -> BinaryIO:
    """Open a file for reading. Raises `FileAway`, also from its methods."""
    return BufferedReader(_ShelfFile(robot_id, address, recording, part), LEAST_AHEAD)


class _ShelfFile(RawIOBase):
    def __init__(self, robot_id: UUID, address: LinkAddress, recording: UUID, part: RecordingPart) -> None:
        self._link: ShelfLink | None = None
        self._robot_id, self._address = robot_id, address
        self._which = recording, part
        self._at = 0
        self._block_at, self._block = -1, memoryview(b"")  # what was read last
        self._ahead = LEAST_AHEAD
        self._size = 0
        self._fetch(LEAST_AHEAD)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def readinto(self, buffer: WriteableBuffer) -> int:
        into = memoryview(buffer)
        if not 0 <= self._at - self._block_at < len(self._block):
            if self._at >= self._size:
                return 0
            self._fetch(len(into))
        begin = self._at - self._block_at
        piece = self._block[begin : begin + len(into)]
        into[: len(piece)] = piece
        self._at += len(piece)
        return len(piece)

    def close(self) -> None:
        self._end_link()
        super().close()

    def _end_link(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None

    def _fetch(self, wanted: int) -> None:
        follows = self._at == self._block_at + len(self._block)
        self._ahead = min(2 * self._ahead, LARGEST_READ) if follows else LEAST_AHEAD
        size = min(max(self._ahead, wanted), LARGEST_READ)
        part, content = self._answer(ShelfRead(*self._which, self._at, size))
        if part.size is None:
            raise FileAway
        self._size, self._block_at, self._block = part.size, self._at, content

    def _answer(self, asked: ShelfRead) -> tuple[ShelfPart, memoryview]:
        try:
            if self._link is not None:
                with suppress(ConnectionClosed):  # the shelf, or the bridge, has ended; it starts again
                    return self._link.read(asked)
                self._end_link()
            self._link = _opened(self._robot_id, self._address)
            return self._link.read(asked)
        except (LinkRefused, ConnectionClosed, TimeoutError, DecodeError) as error:
            self._end_link()  # a late answer must not be read as that of another question
            log.warning("recording %s on %s: %r", asked.recording, self._address.host, error)
            raise FileAway(_HOST_AWAY) from error


def _opened(robot_id: UUID, address: LinkAddress) -> ShelfLink:
    """Open a link. Raises LinkRefused: at once, if the computer was silent just now."""
    began_s = time.monotonic()
    if began_s < _silent_until_s.get(robot_id, 0.0):
        raise LinkRefused(_HOST_AWAY)
    try:
        return ShelfLink(robot_id, address)
    except LinkRefused:
        if time.monotonic() - began_s > SLOW_S:
            _silent_until_s[robot_id] = time.monotonic() + AGAIN_S
        raise
