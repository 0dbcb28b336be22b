"""Uploads one file in parts. A later call goes on with the parts that the store has, whatever ended the earlier one."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import BinaryIO

from robots.recordings.s3.bucket import Bucket, Found, NotThere, Part, family_of, md5

PART_BYTES = 8 * 1024 * 1024  # in memory; S3 wants 5 MiB or more
MOST_PARTS = 10_000  # of S3


class Interrupted(Exception):
    """This process ends: the upload goes on later."""


class Later(Exception):
    """Some recordings could not be treated now. The text says which, and why."""


class Damaged(Exception):
    """The object was not the file, and is removed: it is uploaded again."""


def upload(bucket: Bucket, path: Path, key: str, goes_on: Callable[[], bool]) -> None:
    """Make the object of a file, and check its size and its bytes. Before each part `goes_on` is asked.

    A key stands for one content: parts that the store has are not sent again. Raises `Interrupted`, `StoreAway`,
    `Damaged` or OSError.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        part_bytes = max(PART_BYTES, -(-size // MOST_PARTS))
        try:
            found = bucket.find(key)  # of a process that ended before it could tell
        except NotThere:
            _send(bucket, file, key, part_bytes, goes_on)
            found = bucket.find(key)
        if found.bytes != size or not _is_same(bucket, found, file, key, part_bytes):
            bucket.remove(key)
            raise Damaged(f"the object {key} was not the file")


def forget(bucket: Bucket, key: str) -> None:
    """Remove all objects of a recording, and uploads of this one that were begun."""
    for number in bucket.uploads(key):
        try:
            bucket.abort(key, number)
        except NotThere:
            continue
    forget_others(bucket, family_of(key), ())


def forget_others(bucket: Bucket, family: str, kept: Collection[str]) -> None:
    """Remove the objects of a recording but these."""
    for key in list(bucket.keys(family)):
        if key not in kept:
            bucket.remove(key)


def _send(bucket: Bucket, file: BinaryIO, key: str, part_bytes: int, goes_on: Callable[[], bool]) -> None:
    """Send what the store does not have yet, and make the object."""
    number, stored = _begun(bucket, key)
    parts: list[Part] = []
    while data := file.read(part_bytes):
        if not goes_on():
            raise Interrupted
        part = stored.get(len(parts) + 1)
        if part is None or part.bytes != len(data):
            part = bucket.send(key, number, len(parts) + 1, data)
        parts.append(part)
    bucket.complete(key, number, parts)


def _begun(bucket: Bucket, key: str) -> tuple[str, dict[int, Part]]:
    """Return the newest upload that was begun, with its parts; or begin one."""
    for number in bucket.uploads(key):
        try:
            return number, {part.number: part for part in bucket.parts(key, number)}
        except NotThere:  # it was removed between the two requests
            continue
    return bucket.begin(key), {}


def _is_same(bucket: Bucket, found: Found, file: BinaryIO, key: str, part_bytes: int) -> bool:
    """Return whether the object is the file. A store that encrypts has tags of its own: then all of it is read back."""
    file.seek(0)
    digests = [md5(data) for data in iter(partial(file.read, part_bytes), b"")]
    if found.tag.strip('"') == f"{md5(b''.join(digests)).hex()}-{len(digests)}":
        return True
    return all(
        md5(
            bucket.read(
                key, number * part_bytes, min(part_bytes, found.bytes - number * part_bytes), found.tag
            )
        )
        == digest
        for number, digest in enumerate(digests)
    )
