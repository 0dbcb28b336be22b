"""Django's engine for SQLite, in which the writers of a process wait for each other in turns.

SQLite lets a writer that waits look again after ever longer pauses, up to 0.1 s, so newcomers pass it: of eight threads
that write all the time, one waited five seconds (`timeout`) and was refused. Here one thread of a process at a time
begins a transaction; the others wait for it, without pauses.
"""

from __future__ import annotations

from threading import Lock

from django.db import OperationalError
from django.db.backends.sqlite3 import base

_turn = Lock()


class DatabaseWrapper(base.DatabaseWrapper):
    """A connection."""

    def _start_transaction_under_autocommit(self) -> None:
        """Begin a transaction when it is this thread's turn. Raises `OperationalError` after `timeout`."""
        if not _turn.acquire(timeout=self.settings_dict["OPTIONS"]["timeout"]):
            raise OperationalError("database is locked")
        try:
            super()._start_transaction_under_autocommit()  # type: ignore[misc]  # the stubs leave it out
        finally:
            _turn.release()
