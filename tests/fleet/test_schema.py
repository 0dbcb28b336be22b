"""A database that is newer than the code, or half migrated, is refused with the remedy."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest
from django.db import connection, connections
from django.db.backends.signals import connection_created
from django.db.migrations.recorder import MigrationRecorder
from django.test import Client

from fleet.base.database import schema
from fleet.site.pages.unavailable import answer
from script.stack.database import new_database
from script.stack.places import REPOSITORY
from tests.processes import outside

NEWER = ("robots", "9999_later")  # an app that bridges have, too

pytestmark = pytest.mark.django_db


def newer() -> str:
    MigrationRecorder(connection).record_applied(*NEWER)
    return "newer than this console"


def older() -> str:
    app, name = max(key for key in schema._known() if key[0] == "bookings")
    MigrationRecorder(connection).record_unapplied(app, name)
    return "lacks 1 migrations"


@pytest.mark.parametrize("change", [newer, older])
def test_health_says_what_to_do(change):
    words = change()
    health = Client().get("/healthz")
    assert (health.status_code, health.json()["ok"]) == (503, False)
    assert words in health.json()["text"]
    assert "docs/upgrade.md" in health.json()["text"]


@pytest.mark.parametrize("change", [newer, older])
def test_each_new_connection_is_refused(change, monkeypatch):
    change()
    monkeypatch.setattr(schema, "_fitted_s", float("-inf"))
    other = connections["default"].copy()
    monkeypatch.setattr(schema, "trouble", lambda _other: trouble)
    trouble = "its migrations"
    schema.guard()
    try:
        for _ in range(2):  # the refused connection is not used, either
            with pytest.raises(schema.SchemaRefused):
                other.ensure_connection()
        trouble = None
        other.ensure_connection()
        other.close()
    finally:
        connection_created.disconnect(dispatch_uid="fleet.base.database.schema")


@pytest.mark.parametrize(
    "process",
    [
        ["manage.py", "run_fleet"],
        ["manage.py", "run_records"],
        ["manage.py", "run_housekeeping"],
        ["manage.py", "setup_code"],
        ["-m", "fleet.server", "--port", "0", "fleet.site.asgi:application"],
    ],
    ids=["run_fleet", "run_records", "run_housekeeping", "setup_code", "web"],
)
def test_each_process_ends_with_the_words(process, tmp_path):
    new_database(tmp_path / "fleet.sqlite3")
    with closing(sqlite3.connect(tmp_path / "fleet.sqlite3")) as database, database:
        database.execute("INSERT INTO django_migrations VALUES (NULL, ?, ?, datetime())", NEWER)
    settings = {"FLEET_DEBUG": "1", "FLEET_VAR": str(tmp_path)}
    tmp_path.chmod(0o700)
    command = [sys.executable, *process]
    environment = {**outside(), **settings}
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert "robots.9999_later" in done.stderr


def test_a_database_with_replaced_names_is_no_newer_one():
    recorder = MigrationRecorder(connection)
    recorder.record_applied("accounts", "0001_initial")  # replaced by accounts.0001_squashed
    assert schema.trouble(connection) is None


def test_a_page_says_that_the_release_is_another(rf):
    refused = schema.SchemaRefused("The database lacks 1 migrations of this console.")
    response = answer(rf.get("/", headers={"accept": "application/json"}), refused)
    assert response is not None
    assert (response.status_code, b"database_other_release" in response.content) == (503, True)
