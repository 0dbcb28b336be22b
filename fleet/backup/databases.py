"""The console's database, as backups see it: SQLite or PostgreSQL.

A restored one lies beside it under another name until it is checked; `connected_to` lets the console's code read it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol

from django.db import connection

from fleet.backup.postgresql import Postgresql
from fleet.backup.sqlite import Sqlite


class Database(Protocol):
    """The console's database. Errors are `BackupError` or `OSError`."""

    vendor: str
    file: str  # the name of its copy in an archive
    folder: Path  # where files may lie for the time of the work

    def copy_to(self, file: Path) -> None:
        """Copy the database as it is at one moment, while others use it."""

    def is_used(self) -> bool:
        """Return whether another connection is open."""

    def restored(self, file: Path) -> AbstractContextManager[str]:
        """Make a database from a copy and give its name. It goes with the `with` block, unless `take` took it."""

    def take(self, name: str, stamp: str | None) -> str:
        """Make a restored database the console's. Return the name under which the old one is kept.

        Without a stamp the old one is removed, and the name is blank.
        """


def database() -> Database:
    """Return the console's database."""
    return Sqlite() if connection.vendor == "sqlite" else Postgresql()


@contextmanager
def connected_to(name: str) -> Iterator[None]:
    """Use another database of the same kind. Only for commands: other threads would use it, too."""
    connection.close()
    own, connection.settings_dict["NAME"] = connection.settings_dict["NAME"], name
    try:
        yield
    finally:
        connection.close()
        connection.settings_dict["NAME"] = own
