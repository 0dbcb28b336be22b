"""A SQLite database: its copies while others use it, and its place."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from django.db import connection

from fleet.backup.archive.whole_files import durable, sync
from fleet.backup.errors import BackupError, Damaged


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
    try:
        with closing(_opened(path, "ro")) as file:
            found = "\n".join(row[0] for row in file.execute("PRAGMA integrity_check(5)"))
    except sqlite3.Error as error:
        return str(error)
    return "" if found == "ok" else found


def _opened(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, isolation_level=None)


class Sqlite:
    """The console's database file."""

    vendor = "sqlite"
    file = "database.sqlite3"

    def __init__(self) -> None:
        self._path = Path(connection.settings_dict["NAME"]).absolute()
        self.folder = self._path.parent  # on the same disk: a restored file only needs another name

    def copy_to(self, file: Path) -> None:
        """Copy the database file."""
        try:
            copy_database(self._path, file)
        except sqlite3.Error as error:
            raise BackupError(f"The database cannot be copied: {error}.") from error

    def is_used(self) -> bool:
        """Return whether another connection is open."""
        connection.close()
        return self._path.exists() and is_used(self._path)

    @contextmanager
    def restored(self, file: Path) -> Iterator[str]:
        """Check the file, which can be used as it is."""
        if wrong := damage(file):
            raise Damaged(f"its database is not whole: {wrong}")
        yield str(file)

    def take(self, name: str, stamp: str | None) -> str:
        """Give the restored file the name of the console's. At each moment one of both has that name."""
        connection.close()
        for path in (self._path, Path(name)):
            if path.exists() and is_used(path):  # the journal of a file belongs to its name
                raise BackupError(
                    f"A process has opened {path} meanwhile. Stop the console, and restore again."
                )
        kept = self._path.with_name(f"{self._path.name}.before-{stamp}") if stamp else None
        if kept:
            try:
                kept.hardlink_to(self._path)
            except OSError:  # a file system without hard links
                copy_database(self._path, kept)
            sync(self.folder)
        sync(Path(name))
        Path(name).replace(self._path)
        sync(self.folder)
        return str(kept or "")
