"""A folder for files on their way, on the disk of the database."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fleet.backup.errors import BackupError

NAME = "backup-work"


@contextmanager
def workplace(folder: Path) -> Iterator[Path]:
    """Give an empty folder in this one. Raises `BackupError` while another backup, check or restore uses it."""
    work = folder / NAME
    work.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor = os.open(work, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise BackupError("Another backup, check or restore is at work: wait until it has ended.") from error
    try:
        _empty(work)  # a killed one may have left files
        yield work
    finally:
        _empty(work)
        os.close(descriptor)


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
