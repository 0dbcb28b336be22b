"""A full disk: SQLite's page limit makes writes fail as on a full disk (SQLITE_FULL)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from django.db import connection
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.backends.signals import connection_created
from django.dispatch import receiver

from fleet.audit.errors import AuditUnavailable
from fleet.audit.services import record

_opened: WeakSet[BaseDatabaseWrapper] = WeakSet()  # the connections of all threads; some threads keep theirs


@receiver(connection_created)
def _note(connection: BaseDatabaseWrapper, **_: Any) -> None:
    _opened.add(connection)


# In characters. Large records use up free pages, small records use up the rest of other pages.
FILLERS = (100_000, 1_000, 0)
MOST_PAGES = 4_294_967_294  # as SQLite limits itself
FAILURES = 25  # failures in a row that mean a full disk: records use different pages of an index


class _Limit:
    """Limits its connection once."""

    def __init__(self, pages: int) -> None:
        self._pages = pages

    def __call__(
        self, execute: Callable[..., Any], sql: str, params: Any, many: bool, context: dict[str, Any]
    ) -> Any:
        connection = context["connection"]
        connection.execute_wrappers.remove(self)
        connection.connection.execute(f"PRAGMA max_page_count = {self._pages}").close()
        return execute(sql, params, many, context)


class Disk:
    """The disk of the database file. Between `fill` and `free`, writes of all threads and connections fail."""

    def __init__(self) -> None:
        self._pages = 0

    def fill(self) -> None:
        """Forbid the file to grow, and use up its free space."""
        with connection.cursor() as cursor:
            cursor.execute("PRAGMA page_count")
            self._pages = cursor.fetchone()[0]
        self._limit_kept(self._pages)
        connection_created.connect(self._created)
        for length in FILLERS:
            self._use_up(length)

    def free(self) -> None:
        """Allow new connections to write again."""
        connection_created.disconnect(self._created)
        self._limit_kept(MOST_PAGES)

    def _created(self, connection: BaseDatabaseWrapper, **_: Any) -> None:
        self._limit(connection)

    def _limit_kept(self, pages: int) -> None:
        """Let each connection limit itself in its own thread, before its next query."""
        for kept in list(_opened):
            kept.execute_wrappers.append(_Limit(pages))

    def _limit(self, connection: BaseDatabaseWrapper) -> None:
        with connection.cursor() as cursor:
            cursor.execute(f"PRAGMA max_page_count = {self._pages}")

    def _use_up(self, length: int) -> None:
        failures = 0
        while failures < FAILURES:
            try:
                record("audit.verify", parameters={"x": "x" * length})
                failures = 0
            except AuditUnavailable as full:
                assert full.code == "audit_disk_full"
                failures += 1
