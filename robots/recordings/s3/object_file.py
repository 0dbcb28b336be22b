"""A recording in the object store as a file that is open for reading."""

from __future__ import annotations

import io
import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, BinaryIO, TypeVar, cast

from django.conf import settings

from robots.recordings.away import FileAway
from robots.recordings.s3.bucket import Bucket, NotThere, StoreAway
from robots.shared.wire import Refusal

AHEAD_BYTES = 1024 * 1024  # at least so much is read at a time
PATIENCE_S = 6.0  # for each answer
AGAIN_S = 0.3  # pause before the second try
QUIET_S = 5.0  # a store that did not answer at all is left alone: each try would keep a thread busy

_AWAY = Refusal(
    "store_away",
    "The object store with this recording does not answer, or refuses the console: try again later.",
    "robot",
)
_LOST = Refusal("recording_lost", "The file of this recording is missing in the object store.", "robot")

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

T = TypeVar("T")
log = logging.getLogger(__name__)
_quiet_until_s = 0.0  # (monotonic)


def open_object(key: str) -> BinaryIO:
    """Open an object. Opening and reading raise `FileAway`."""
    return cast(BinaryIO, io.BufferedReader(_ObjectFile(_bucket(), key), AHEAD_BYTES))


def read_object(key: str) -> bytes:
    """Return all of a small object. Raises `FileAway`."""
    bucket = _bucket()
    return _tried(lambda: bucket.read(key))


class _ObjectFile(io.RawIOBase):
    """Each read is a request for a range of the object as it was when it was opened."""

    def __init__(self, bucket: Bucket, key: str) -> None:
        self._bucket, self._key = bucket, key
        self._found = _tried(lambda: bucket.find(key))
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        begin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._found.bytes}[whence]
        self._at = max(begin + offset, 0)
        return self._at

    def readinto(self, buffer: WriteableBuffer) -> int:
        into = memoryview(buffer)
        count = min(len(into), self._found.bytes - self._at)
        if count <= 0:
            return 0
        data = _tried(lambda: self._bucket.read(self._key, self._at, count, self._found.tag))
        into[: len(data)] = data
        self._at += len(data)
        return len(data)

    def readall(self) -> bytes:
        return b"".join(iter(lambda: self.read(AHEAD_BYTES), b""))  # the inherited one makes small requests


def _bucket() -> Bucket:
    if settings.FLEET_S3 is None:
        raise FileAway(_AWAY)
    return Bucket(settings.FLEET_S3, PATIENCE_S)


def _tried(call: Callable[[], T]) -> T:
    """Return the result of the first or second try."""
    global _quiet_until_s
    try:
        if time.monotonic() < _quiet_until_s:
            raise FileAway(_AWAY)
        try:
            return call()
        except NotThere:
            raise
        except StoreAway:
            time.sleep(AGAIN_S)
            return call()
    except NotThere as error:
        raise FileAway(_LOST) from error
    except StoreAway as error:
        log.warning("%s", error)
        if error.silent:
            _quiet_until_s = time.monotonic() + QUIET_S
        raise FileAway(_AWAY) from error
