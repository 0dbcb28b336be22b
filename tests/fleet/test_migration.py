"""A database with the migrations from before 2026-11-23 migrates; one squashed migration per app replaces them."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from unittest import mock

import pytest
from django.core.management import call_command
from django.core.management.base import SystemCheckError
from django.db import connection, connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.migrations.loader import MigrationLoader
from django.db.migrations.recorder import MigrationRecorder

from fleet.audit.integrity import triggers
from fleet.audit.integrity.verify import verify
from fleet.audit.models import Chain, Record
from fleet.audit.services import record
from script.stack.database import new_database

ROBOT = uuid.UUID("7b0c1d9e-0000-4000-8000-000000000001")
APPS = ["accounts", "audit", "robots", "teleop"]


@contextmanager
def empty_database(tmp_path: Path) -> Iterator[BaseDatabaseWrapper]:
    """The default connection to an unmigrated database."""
    name = str(tmp_path / "old.sqlite3") if connection.vendor == "sqlite" else f"old_{uuid.uuid4().hex}"
    if connection.vendor == "postgresql":
        with connection._nodb_cursor() as cursor:
            cursor.execute(f"CREATE DATABASE {name}")
    other = connections["default"].copy()
    other.settings_dict["NAME"] = name
    try:
        with closing(other), mock.patch.object(connections._connections, "default", other):
            yield other
    finally:
        if connection.vendor == "postgresql":
            with connection._nodb_cursor() as cursor:
                cursor.execute(f"DROP DATABASE {name} WITH (FORCE)")


@contextmanager
def old_database(tmp_path: Path) -> Iterator[MigrationRecorder]:
    """A database in which the replaced migrations were applied by their old names, with one record."""
    with empty_database(tmp_path) as database:
        if database.vendor == "sqlite":
            new_database(Path(database.settings_dict["NAME"]))  # a copy: to migrate takes 4 s
        else:
            call_command("migrate", verbosity=0)
        record("speech.start", robot_id=ROBOT, robot_name="TIAGo 1", text="Hello.")
        recorder = MigrationRecorder(database)
        for (app, name), migration in MigrationLoader(database).replacements.items():
            recorder.record_unapplied(app, name)
            for old in migration.replaces:
                recorder.record_applied(*old)
        yield recorder


@pytest.mark.django_db(transaction=True)
def test_a_database_with_the_old_names_keeps_its_rows(tmp_path):
    with old_database(tmp_path) as recorder:
        call_command("migrate", verbosity=0, skip_checks=False)
        assert {(app, "0001_squashed") for app in APPS} <= set(recorder.applied_migrations())
        assert [said.details["text"] for said in Record.objects.filter(robot_id=ROBOT)] == ["Hello."]
        assert verify(Chain.objects.all()).findings == []
        assert triggers.amiss(connection) == {}


@pytest.mark.parametrize("app", APPS)
@pytest.mark.django_db(transaction=True)
def test_a_database_with_some_old_names_only_is_refused(app, tmp_path):
    with old_database(tmp_path) as recorder:
        replaced = (
            MigrationLoader(None, ignore_no_migrations=True).disk_migrations[app, "0001_squashed"].replaces
        )
        last = max(name for _, name in replaced)
        recorder.record_unapplied(app, last)
        with pytest.raises(SystemCheckError, match=f"migrations that {app}.0001_squashed replaces"):
            call_command("migrate", verbosity=0, skip_checks=False)
