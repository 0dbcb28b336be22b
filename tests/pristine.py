"""A copy of the new test database, to restore it after each transactional test.

Django empties all tables after a transactional test; the audit log's triggers refuse this. So the copy is restored
instead: triggers stay on, and the rows that migrations wrote are there without running the migrations again.
"""

from __future__ import annotations

import sqlite3
from typing import Any, Protocol
from weakref import WeakSet

from django.db import connection, connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.backends.signals import connection_created

from tests.late_calls import close_connections


class Pristine(Protocol):
    """A copy of the test database."""

    def restore(self) -> None:
        """Restore the test database. No transaction may be open."""

    def forget(self) -> None:
        """Remove the copy."""


def pristine_copy() -> Pristine:
    """Copy the test database as it is now."""
    return OnSQLite() if connection.vendor == "sqlite" else OnPostgreSQL()


class OnSQLite:
    """A copy in memory. One transaction writes it over the file, so connections of other threads stay usable.

    Its own connection stays open: the last one that closes writes the whole journal into the file and removes it,
    which would take each test some milliseconds.
    """

    def __init__(self) -> None:
        self._live = sqlite3.connect(connection.settings_dict["NAME"])
        self._live.execute("PRAGMA synchronous=OFF")
        self._copy = sqlite3.connect(":memory:")
        self._live.backup(self._copy)

    def restore(self) -> None:
        close_connections()  # one that has read the schema before might look for tables where they are no more
        self._copy.backup(self._live)

    def forget(self) -> None:
        self._copy.close()
        self._live.close()


class OnPostgreSQL:
    """A template database. No database in use can be restored: first, all threads' connections are closed."""

    def __init__(self) -> None:
        self._name = connection.settings_dict["NAME"]
        self._copy = f"{self._name}_pristine"
        self._opened: WeakSet[BaseDatabaseWrapper] = WeakSet([connections["default"]])
        connection_created.connect(self._note)
        self._close_all()
        self._make(self._copy, self._name)

    def restore(self) -> None:
        self._close_all()
        self._drop(self._name)
        self._make(self._name, self._copy)

    def forget(self) -> None:
        connection_created.disconnect(self._note)
        self._drop(self._copy)

    def _note(self, connection: BaseDatabaseWrapper, **_: Any) -> None:
        self._opened.add(connection)

    def _close_all(self) -> None:
        for opened in list(self._opened):
            opened.inc_thread_sharing()  # safe: the threads are idle
            try:
                opened.close()
            finally:
                opened.dec_thread_sharing()

    def _make(self, name: str, template: str) -> None:
        self._execute(f'CREATE DATABASE "{name}" TEMPLATE "{template}"')

    def _drop(self, name: str) -> None:
        self._execute(f'DROP DATABASE "{name}" WITH (FORCE)')

    def _execute(self, statement: str) -> None:
        with connection._nodb_cursor() as cursor:
            cursor.execute(statement)
