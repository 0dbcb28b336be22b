"""Changes to the audit tables that the console's triggers would refuse."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from django.db import DatabaseError, connection, transaction


@contextmanager
def past_the_triggers() -> Iterator[None]:
    """Remove the triggers during a `with` block. The search index still follows changes."""
    with transaction.atomic(), connection.cursor() as cursor:
        if connection.vendor == "postgresql":
            cursor.execute("SET LOCAL session_replication_role = replica")
            yield
            cursor.execute("SET LOCAL session_replication_role = origin")
            return
        cursor.execute(
            "SELECT name, sql FROM sqlite_master WHERE type = 'trigger' AND name NOT LIKE '%index'"
        )
        triggers = cursor.fetchall()
        for name, _sql in triggers:
            cursor.execute(f"DROP TRIGGER {name}")
        yield
        for _name, sql in triggers:
            cursor.execute(sql)


def tamper(statement: str, *values: Any) -> None:
    """Run a statement without the console and its triggers."""
    with past_the_triggers(), connection.cursor() as cursor:
        cursor.execute(statement, values)
        assert cursor.rowcount, "the statement met nothing"


def index_anew() -> None:
    """Rebuild the search index from the current texts. PostgreSQL does this by itself."""
    if connection.vendor == "sqlite":
        with connection.cursor() as cursor:
            cursor.execute("INSERT INTO audit_content_search (audit_content_search) VALUES ('rebuild')")


def refused_by_the_database(statement: str) -> str:
    """Return the error text of a statement that the database refuses, or "not refused"."""
    try:
        with transaction.atomic(), connection.cursor() as cursor:
            cursor.execute(statement)
    except DatabaseError as error:
        return str(error)
    return "not refused"
