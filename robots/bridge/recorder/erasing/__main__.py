"""``python -m robots.bridge.recorder.erasing``: cuts one file on this computer.

It reads a `FileCut` (JSON) from stdin, and writes the same with what the file is then to stdout. The old file stays as
it is until the new one is whole and on the disk, so this may be killed at any time, and is repeated.
"""

from __future__ import annotations

import errno
import fcntl
import os
import sys
from pathlib import Path
from typing import BinaryIO, cast

import msgspec
from mcap.exceptions import McapError
from msgspec import structs

from robots.bridge.recorder.erasing.rewriting import done_before, rewrite
from robots.bridge.recorder.files.directory import (
    DRAFT,
    PICTURE,
    RESERVE_BYTES,
    RecordingDirectory,
    sync_folder,
)
from robots.bridge.recorder.files.finished_files import make_picture
from robots.shared.records.record_sink import FileCut, TakenRecording

NICE = 19  # nobody waits for it
_ALL_NS = 2**63 - 1


def main() -> None:
    """Cut the file. Says nothing if another process does so; ends with a reason if it cannot be done now."""
    os.nice(NICE)
    cut = msgspec.json.decode(sys.stdin.buffer.read(), type=FileCut)
    try:
        taken = cut_file(cut)
    except BlockingIOError:
        return
    except (OSError, McapError) as error:
        raise SystemExit(str(error)) from error
    sys.stdout.buffer.write(msgspec.json.encode(structs.replace(cut, taken=taken)))


def cut_file(cut: FileCut) -> TakenRecording:
    """Replace the file by what stays of it, or remove it. Raises OSError, McapError."""
    directory = RecordingDirectory(Path(cut.taken.directory), 0)
    path = directory.path_of(cut.taken.name)
    draft = path.with_suffix(DRAFT)
    path.stat()  # a file that is not there leaves no draft
    with _locked(draft) as target, path.open("rb") as source:
        if (taken := done_before(source, cut)) is not None:
            draft.unlink()
            return structs.replace(taken, thumbnail=path.with_suffix(PICTURE).exists())
        room = os.statvfs(path.parent)
        if room.f_bavail * room.f_frsize < os.fstat(source.fileno()).st_size + RESERVE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        target.truncate()
        taken = rewrite(source, target, cut)
        if not taken.bytes:
            directory.remove(taken.recording)
            return structs.replace(taken, thumbnail=False)
        os.fsync(target)
        if not any(begin <= 0 and end >= _ALL_NS for begin, end in cut.stays):
            path.with_suffix(PICTURE).unlink(missing_ok=True)  # nobody knows when it was taken
            taken = structs.replace(taken, thumbnail=make_picture(draft))
        path.stat()  # it was not removed meanwhile
        draft.replace(path)
        sync_folder(path.parent)
    return taken


def _locked(draft: Path) -> BinaryIO:
    """Open the draft, also one of a process that was killed. Raises OSError if another process writes it."""
    file = cast(BinaryIO, os.fdopen(os.open(draft, os.O_RDWR | os.O_CREAT, 0o600), "r+b", buffering=0))
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(file.fileno()), draft.stat()):  # it became the file meanwhile
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN), str(draft))
    except OSError:
        file.close()
        raise
    return file


if __name__ == "__main__":
    main()
