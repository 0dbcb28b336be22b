"""Whether the database has the schema of this code. Every process refuses to work with another one.

`guard` looks at each new connection, at most once a minute; a stop and the commands that mend a database use any.
"""

from __future__ import annotations

import sys
import time
from functools import cache
from typing import Any

from django.apps import apps
from django.conf import settings
from django.db import DatabaseError, OperationalError, connection
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.backends.signals import connection_created
from django.db.migrations.loader import MigrationLoader
from django.db.migrations.recorder import MigrationRecorder

from fleet.base.version import log_start, release

AGAIN_S = 60.0
# Commands of manage.py that must work with any schema.
UNGUARDED = {
    *("stop", "upgrade", "backup", "restore", "version"),
    *("migrate", "showmigrations", "sqlmigrate", "makemigrations", "squashmigrations", "optimizemigration"),
    *("check", "dbshell", "inspectdb", "collectstatic", "test"),
}
NAMED = 5  # migrations that a refusal names

_fitted_s = float("-inf")  # when the schema was last found to be this code's


class SchemaRefused(OperationalError):
    """The database has another schema than this code; the text says what to do."""


def guard() -> None:
    """From now on, refuse connections to a database with another schema."""
    connection_created.connect(_look, dispatch_uid="fleet.base.database.schema")


def begin(process: str) -> None:
    """Begin a process that uses the database: log the release, and end if the schema is another one.

    A database that does not answer is looked at when it does.
    """
    log_start(process)
    guard()
    try:
        connection.ensure_connection()
    except SchemaRefused as refused:
        sys.exit(str(refused))
    except DatabaseError:
        pass
    finally:
        connection.close()


def trouble(database: BaseDatabaseWrapper) -> str | None:
    """Return in words why this code must not use the database; None if it may."""
    applied = set(MigrationRecorder(database).applied_migrations())
    if settings.FLEET_SOME_APPS:
        applied = {(app, name) for app, name in applied if app in apps.app_configs}
    if newer := newer_migrations(applied):
        return (
            f"The database is newer than this console ({release()}), which does not know its migrations {newer}. "
            "Start the release that it belongs to, or restore the backup from before the upgrade (docs/upgrade.md)."
        )
    if missing := missing_migrations(applied):
        return (
            f"The database lacks {len(missing)} migrations of this console ({release()}). "
            "Start it on the console's computer first, or run: manage.py upgrade (docs/upgrade.md)."
        )
    return None


def newer_migrations(applied: Any) -> str:
    """Return the names of applied migrations that this code does not have; blank: none."""
    known = _known()
    unknown = sorted(set(applied) - known.keys() - {old for replaced in known.values() for old in replaced})
    names = ", ".join(f"{app}.{name}" for app, name in unknown[:NAMED])
    return f"{names}, …" if len(unknown) > NAMED else names


def missing_migrations(applied: Any) -> list[tuple[str, str]]:
    """Return app and name of this code's migrations that are not applied."""
    return [key for key, replaced in _known().items() if not _is_applied(key, replaced, applied)]


@cache
def _known() -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return all migrations of this code, each with those that it replaces."""
    found = MigrationLoader(None, ignore_no_migrations=True).disk_migrations
    return {key: list(migration.replaces) for key, migration in found.items()}


def _is_applied(key: tuple[str, str], replaced: list[tuple[str, str]], applied: Any) -> bool:
    return key in applied or (bool(replaced) and all(old in applied for old in replaced))


def _look(connection: BaseDatabaseWrapper, **_: Any) -> None:
    global _fitted_s
    if time.monotonic() - _fitted_s < AGAIN_S:
        return
    try:
        refused = trouble(connection)
    except BaseException:
        connection.close()
        raise
    if refused is not None:
        connection.close()  # else the next query would use it
        raise SchemaRefused(refused)
    _fitted_s = time.monotonic()
