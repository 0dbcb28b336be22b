"""The archive: a tar file, compressed, and encrypted if asked. Its first entry says what it is, its last has digests.

`tar xzf` opens it, after `age --decrypt`; `sha256sum --check SHA256SUMS` checks it.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import tarfile
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import IO, Any, BinaryIO, NamedTuple, cast

import msgspec
from msgspec import Struct

from fleet.backup.archive.age import MAGIC, Decrypting, Encrypting
from fleet.backup.errors import Damaged

MANIFEST = "manifest.json"
SUMS = "SHA256SUMS"
LONGEST_LISTING = 100_000_000  # bytes of manifest or digests
PIECE = 1 << 20
SPEED = 1  # of compression: ten times as fast as the best, for a tenth more room
# The errors that the readers below raise for a damaged archive.
_UNREADABLE = (
    tarfile.TarError,
    gzip.BadGzipFile,
    EOFError,
    zlib.error,
    msgspec.MsgspecError,
    UnicodeDecodeError,
)


class Manifest(Struct, frozen=True):
    """The manifest of an archive."""

    version: str  # of the console that made it
    commit: str
    made_at: datetime
    host: str
    database: str  # sqlite or postgresql
    migrations: list[str]  # "app.name" of each that the database has
    secret_key: str  # a digest, to recognise the key


class Entry(NamedTuple):
    """A file of the archive: its name there, and where its bytes are."""

    name: str
    source: Path | bytes


def write(file: BinaryIO, manifest: Manifest, entries: Iterable[Entry], passphrase: str | None) -> None:
    """Write an archive."""
    encrypting = Encrypting(file, passphrase) if passphrase else None
    sums: list[str] = []
    sink = cast(BinaryIO, encrypting or file)
    with (
        gzip.GzipFile("", "wb", SPEED, sink) as compressing,
        tarfile.open(fileobj=compressing, mode="w|", bufsize=PIECE) as tar,
    ):
        for name, source in (Entry(MANIFEST, _json(manifest)), *entries):
            with BytesIO(source) if isinstance(source, bytes) else source.open("rb") as content:
                sums.append(f"{_add(tar, name, content)}  {name}\n")
        _add(tar, SUMS, BytesIO("".join(sums).encode()))
    if encrypting:
        encrypting.close()


def _json(manifest: Manifest) -> bytes:
    return msgspec.json.format(msgspec.json.encode(manifest)) + b"\n"


def _add(tar: tarfile.TarFile, name: str, content: IO[bytes]) -> str:
    """Add a file, and return its digest."""
    entry = tarfile.TarInfo(name)
    entry.size = content.seek(0, os.SEEK_END)
    content.seek(0)
    entry.mode, entry.mtime = 0o600, int(time.time())
    hashing = _Hashing(content)
    tar.addfile(entry, cast(IO[bytes], hashing))
    return hashing.digest()


class Archive:
    """An archive that is read from its beginning to its end."""

    def __init__(self, tar: tarfile.TarFile) -> None:
        self._tar = tar
        self._sums: dict[str, str] = {}
        first = tar.next()
        if first is None or first.name != MANIFEST:
            raise Damaged("it is no backup of the console")
        text = self._content(first).read(LONGEST_LISTING)
        self._sums[MANIFEST] = hashlib.sha256(text).hexdigest()
        self.manifest = msgspec.json.decode(text, type=Manifest)

    def extract(self, folder: Path) -> None:
        """Write all other files into the folder. Raises `Damaged` if one is missing or has another digest."""
        with _damage_in_words():
            while (entry := self._tar.next()) is not None:
                if entry.name == SUMS:
                    self._compare(self._content(entry).read(LONGEST_LISTING).decode())
                    return
                content = _Hashing(self._content(entry))
                target = folder / _inside(entry.name)
                target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                with target.open("xb") as file:
                    while piece := content.read(PIECE):
                        file.write(piece)
                self._sums[entry.name] = content.digest()
            raise Damaged("its end is missing")

    def _compare(self, listing: str) -> None:
        listed = {name: digest for digest, _, name in (line.partition("  ") for line in listing.splitlines())}
        wrong = [name for name in listed.keys() | self._sums if listed.get(name) != self._sums.get(name)]
        if wrong:
            raise Damaged(f"{min(wrong)} has another digest than it was written with")

    def _content(self, entry: tarfile.TarInfo) -> IO[bytes]:
        content = self._tar.extractfile(entry) if entry.isfile() else None
        if content is None:
            raise Damaged(f"{entry.name} is no file")
        return content


@contextmanager
def opened(path: Path, passphrase: Callable[[], str]) -> Iterator[Archive]:
    """Open an archive. `passphrase` is called if it is encrypted. Raises `WrongPassphrase` or `Damaged`."""
    with path.open("rb") as file:
        encrypted = file.read(len(MAGIC)) == MAGIC
        file.seek(0)
        source: Any = Decrypting(file, passphrase()) if encrypted else file
        with gzip.GzipFile(fileobj=source) as clear, ExitStack() as held:
            with _damage_in_words():
                archive = Archive(held.enter_context(tarfile.open(fileobj=clear, mode="r|", bufsize=PIECE)))
            yield archive


@contextmanager
def _damage_in_words() -> Iterator[None]:
    try:
        yield
    except _UNREADABLE as error:
        raise Damaged(f"it cannot be read: {error}") from error


def _inside(name: str) -> Path:
    """Return the path of an entry. Raises `Damaged` for one that leads out of the folder."""
    parts = PurePosixPath(name).parts
    if not parts or name.startswith("/") or ".." in parts:
        raise Damaged(f"{name} leads out of it")
    return Path(*parts)


class _Hashing:
    """Reads a file and computes its digest."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._sha256 = hashlib.sha256()

    def read(self, size: int) -> bytes:
        piece = self._file.read(size)
        self._sha256.update(piece)
        return piece

    def digest(self) -> str:
        return self._sha256.hexdigest()
