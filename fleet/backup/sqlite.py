"""Copies of a SQLite database, while other processes use it."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from fleet.backup.files import durable


def copy_database(source: Path, target: Path) -> None:
    """Copy the database file `source` to `target`, a single file of its owner, as it is at one moment.

    Readers and writers go on meanwhile. Without room, nothing is left at `target`. Raises `sqlite3.Error` or `OSError`.
    """
    with durable(target) as part:
        part.touch(0o600)
        with closing(_opened(source, "ro")) as live, closing(_opened(part, "rw")) as copy:
            copy.execute("PRAGMA synchronous=OFF")  # `durable` waits for the disk, once
            live.backup(copy)  # in one step: a writer of another process would let it begin again and again
            copy.execute("PRAGMA journal_mode=DELETE")  # no files beside it


def _opened(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, isolation_level=None)


def is_used(path: Path) -> bool:
    """Return whether another connection is open. If none is, the journal is written into the file and removed."""
    with closing(_opened(path, "rw")) as alone:
        alone.execute("PRAGMA busy_timeout=0")
        try:
            alone.execute("PRAGMA journal_mode=DELETE")
        except sqlite3.OperationalError:
            return True
    return False


def damage(path: Path) -> str:
    """Return what SQLite finds wrong in the file; blank: nothing."""
    with closing(_opened(path, "ro")) as file:
        found = "\n".join(row[0] for row in file.execute("PRAGMA integrity_check(5)"))
    return "" if found == "ok" else found
