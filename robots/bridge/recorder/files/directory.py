"""The directory of recordings on one computer: names of files, what may be removed, and how much room is left.

All recorders of the computer share it. A recording is BEGIN-KIND-UUID.mcap, such as
20261130T103000Z-black_box-7c1f….mcap, while it is written with the ending .part and a lock. Beside it may be: .jpg, a
small picture; .new: it has no row yet; .kept: somebody keeps it; .draft: what will replace it (`erasing`). No name
comes from a person or a robot.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast
from uuid import UUID

from robots.shared.sentences import say
from robots.shared.wire import RecordingKind, Refusal

FILE, PART, NEW, KEPT, PICTURE, DRAFT = ".mcap", ".part", ".new", ".kept", ".jpg", ".draft"
# Written to the end if the disk fills otherwise: a second of data, and the summary
RESERVE_BYTES = 64 * 1024 * 1024
COUNT_S = 10.0  # between two counts of all files: other processes write there, too
_NAME = re.compile(
    r"(\d{8}T\d{6}Z)-(black_box|by_hand|booking)-([0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12})"
)

DISK_FULL = Refusal("disk_full", "The disk for recordings is full.", "limits")
READ_ONLY = Refusal("disk_read_only", "The disk for recordings cannot be written: it is read-only.", "limits")
DISK_GONE = Refusal("disk_gone", "The directory for recordings is gone.", "limits")
_FAULTS = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), DISK_FULL),
    **dict.fromkeys((errno.EROFS, errno.EACCES, errno.EPERM), READ_ONLY),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR, errno.ENODEV, errno.ESTALE), DISK_GONE),
}


class NoRoom(Exception):
    """Nothing may be written; `refusal` has the reason."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


def refusal_of(error: OSError) -> Refusal:
    """Return why a recording cannot be written."""
    if error.errno in _FAULTS:
        return _FAULTS[error.errno]
    text = say("The recording cannot be written: {why}.", why=error.strerror or str(error))
    return Refusal("disk_failed", text, "limits")


def sync_folder(path: Path) -> None:
    """Make sure that new names of files survive a power cut."""
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


class Entry(NamedTuple):
    """A finished recording in the directory."""

    path: Path
    recording: UUID
    kind: RecordingKind
    bytes: int
    kept: bool


class Draft(NamedTuple):
    """A file that is being written. It is locked until `stream` is closed."""

    path: Path
    stream: BinaryIO


class RecordingDirectory:
    """The recordings below one path. Any method may raise OSError: the disk may be gone.

    `quota_bytes`: for all files together. `least_free_bytes`: left for the rest of the computer.
    """

    def __init__(self, path: Path, quota_bytes: int, least_free_bytes: int = RESERVE_BYTES) -> None:
        self.path = path
        self._quota_bytes = quota_bytes
        self._least_free_bytes = max(least_free_bytes, RESERVE_BYTES)
        self._counted_bytes = 0
        self._counted_s = float("-inf")

    def prepare(self) -> None:
        """Make sure that the directory exists. Its parent must: a disk that is not mounted is no directory."""
        self.path.mkdir(mode=0o700, exist_ok=True)

    def begin(self, kind: RecordingKind, recording: UUID, begins: float) -> Draft:
        """Create a file and lock it."""
        begin = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(begins))
        path = self.path / f"{begin}-{kind}-{recording}{PART}"
        # Unbuffered: what `write` returns is in the file; it is also read again, if the disk fills
        stream = cast(BinaryIO, path.open("x+b", buffering=0))
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return Draft(path, stream)

    def publish(self, draft: Draft) -> Path:
        """Give a finished file its name, on disk, and note that it has no row yet."""
        os.fsync(draft.stream)
        draft.path.with_suffix(NEW).touch()
        finished = draft.path.with_suffix(FILE)
        draft.path.rename(finished)
        draft.stream.close()
        sync_folder(self.path)
        return finished

    def discard(self, draft: Draft) -> None:
        """Remove a file that has nothing in it."""
        draft.path.unlink(missing_ok=True)
        draft.stream.close()

    def stored(self, recording: UUID) -> None:
        """Note that a recording has its row."""
        for path in self.path.glob(f"*-{recording}{NEW}"):
            path.unlink(missing_ok=True)

    def without_row(self) -> list[Path]:
        """Return the finished files that have no row yet, the oldest first."""
        marked = {path.stem for path in self._with(NEW)}
        return [path for path in self._with(FILE) if path.stem in marked]

    def cut(self) -> Iterator[Draft]:
        """Yield, locked, the files whose writer broke."""
        for path in self._with(PART):
            try:
                stream = cast(BinaryIO, path.open("r+b", buffering=0))
            except FileNotFoundError:  # another recorder finished it
                continue
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:  # it is being written
                stream.close()
                continue
            if path.exists():
                yield Draft(path, stream)
            else:  # finished between the two calls
                stream.close()

    def entries(self) -> list[Entry]:
        """Return the finished recordings, the oldest first."""
        kept = {path.stem for path in self._with(KEPT)}
        found = []
        for path in self._with(FILE):
            if (name := _NAME.fullmatch(path.stem)) is None:
                continue
            with suppress(FileNotFoundError):
                size = path.stat().st_size
                kind = cast(RecordingKind, name[2])
                found.append(Entry(path, UUID(name[3]), kind, size, path.stem in kept))
        return found

    def recordings(self) -> set[UUID]:
        """Return which finished recordings are here."""
        found = (_NAME.fullmatch(path.stem) for path in self._with(FILE))
        return {UUID(name[3]) for name in found if name is not None}

    def find(self, recording: UUID) -> Path:
        """Return the finished file of a recording. Raises OSError."""
        for path in self.path.glob(f"*-{recording}{FILE}"):
            return path
        raise FileNotFoundError(errno.ENOENT, "there is no such recording", str(recording))

    def keep(self, recording: UUID) -> None:
        """Keep a recording: it is not removed for newer ones."""
        for path in self.path.glob(f"*-{recording}{FILE}"):
            path.with_suffix(KEPT).touch()

    def let_go(self, recording: UUID) -> None:
        """Let a recording be removed for newer ones again."""
        for path in self.path.glob(f"*-{recording}{KEPT}"):
            path.unlink(missing_ok=True)

    def remove(self, recording: UUID) -> None:
        """Remove a recording, with what is beside it."""
        for path in self.path.glob(f"*-{recording}{FILE}"):
            self._remove(path)

    def path_of(self, name: str) -> Path:
        """Return where a finished recording is. Raises FileNotFoundError: this is no name of one."""
        if _NAME.fullmatch(name.removesuffix(FILE)) is None:
            raise FileNotFoundError(errno.ENOENT, "no name of a recording", name)
        return self.path / name

    def make_room(self, more: int) -> list[UUID]:
        """Remove the oldest black boxes that nobody keeps until `more` bytes fit; return them. Raises NoRoom.

        The disk must have room, too. Black boxes are not removed for what others write there.
        """
        if self._free_on_disk() < more:
            raise NoRoom(DISK_FULL)
        if self._used() + more <= self._quota_bytes:
            return []
        removed = []
        used = self._count()
        entries = iter(self.entries())
        while used + more > self._quota_bytes:
            oldest = next((one for one in entries if one.kind == "black_box" and not one.kept), None)
            if oldest is None:
                text = say(
                    "The recordings take all the room that they may have ({gigabytes:.1f} GB): "
                    "remove some that are not needed.",
                    gigabytes=self._quota_bytes / 1e9,
                )
                raise NoRoom(Refusal("quota_full", text, "limits", {"quota_bytes": self._quota_bytes}))
            self._remove(oldest.path)
            removed.append(oldest.recording)
            used -= oldest.bytes
        self._counted_bytes = used
        return removed

    def wrote(self, more: int) -> None:
        """Note that files have grown."""
        self._counted_bytes += more

    def free_bytes(self) -> int:
        """Return how much may still be written without the removal of a black box."""
        return max(0, min(self._quota_bytes - self._used(), self._free_on_disk()))

    def _used(self) -> int:
        """Return the size of all files, as of the last count."""
        if time.monotonic() - self._counted_s > COUNT_S:
            self._count()
        return self._counted_bytes

    def _count(self) -> int:
        """Return the size of all files now."""
        used = 0
        with os.scandir(self.path) as entries:
            for entry in entries:
                with suppress(FileNotFoundError):
                    used += entry.stat().st_size
        self._counted_bytes, self._counted_s = used, time.monotonic()
        return used

    def _free_on_disk(self) -> int:
        room = os.statvfs(self.path)
        return room.f_bavail * room.f_frsize - self._least_free_bytes

    def _with(self, ending: str) -> list[Path]:
        return sorted(
            path for path in self.path.iterdir() if path.suffix == ending and _NAME.fullmatch(path.stem)
        )

    def _remove(self, path: Path) -> None:
        # The file last: as long as it is there, it is removed again
        for ending in (NEW, KEPT, PICTURE, DRAFT, FILE):
            path.with_suffix(ending).unlink(missing_ok=True)
