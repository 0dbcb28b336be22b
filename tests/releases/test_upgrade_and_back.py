"""A database of each past release comes to this one whole, as docs/upgrade.md says, and goes back by its backup."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import psycopg
import pytest

from fleet.base.version import version
from script.stack.database import new_database
from tests.processes import REPOSITORY, outside, until
from tests.script.servers import postgresql

# The commit of each release, and of the oldest state that is upgraded.
PAST = {"2026-11-22": "84c31634", "0.1.0": "cb14b421"}
HERE = Path(__file__).parent


class Console:
    """The code of a release, and its settings."""

    def __init__(self, code: Path, var: Path, **settings: str) -> None:
        self.code = code
        self.environment = {
            **outside(),
            "PYTHONPATH": str(code),
            "DJANGO_SETTINGS_MODULE": "fleet.settings",
            "FLEET_SECRET_KEY": "a key for one test, which protects nothing at all",
            "FLEET_HOSTS": "localhost",
            "FLEET_DEBUG": "1",  # pages need no collected files
            "FLEET_VAR": str(var),
            **settings,
        }

    def run(self, *words: str | Path, status: int = 0) -> str:
        """Run Python; return what it wrote, also to stderr if it should fail."""
        command = [sys.executable, *map(str, words)]
        done = subprocess.run(command, cwd=self.code, env=self.environment, capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        return done.stderr if status else done.stdout

    def said(self, script: str) -> Any:
        """Return the JSON that a script of this folder prints last."""
        return json.loads(self.run(HERE / script, "facts").splitlines()[-1])


@pytest.fixture(params=PAST)
def past(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The code of a past release."""
    return code_of(PAST[request.param], tmp_path)


def code_of(commit: str, tmp_path: Path) -> Path:
    archive = subprocess.run(["git", "archive", commit], cwd=REPOSITORY, capture_output=True)
    if archive.returncode:
        pytest.skip(f"this clone does not have the commit {commit}")
    code = tmp_path / "past"
    code.mkdir()
    subprocess.run(["tar", "x", "-C", code], input=archive.stdout, check=True)
    return code


def filled(console: Console) -> Any:
    """Migrate and fill the database of a past release; return what is in it."""
    console.run("manage.py", "migrate", "--no-input", "-v", "0", "--skip-checks")
    console.run(HERE / "past.py", "seed")
    return console.said("past.py")


def assert_works(console: Console) -> None:
    """Assert that this release works with its database."""
    seen = console.said("present.py")
    assert (seen["findings"], seen["triggers"]) == ([], {})
    assert seen["health"]["ok"], seen["health"]
    assert set(seen["pages"].values()) == {200}, seen["pages"]
    assert (seen["report"], seen["log"]) == (200, 200)


def schema(path: Path) -> dict[str, Any]:
    """Return tables, indexes and triggers of a SQLite database."""
    with closing(sqlite3.connect(path)) as database:
        named = database.execute(
            "SELECT name, type, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite_%'"
        ).fetchall()
        tables = [name for name, kind, _ in named if kind == "table"]
        columns = {
            table: sorted(row[1:] for row in database.execute(f"PRAGMA table_info({table})"))
            for table in tables
        }
    return columns | {name: sql for name, kind, sql in named if kind != "table"}


def test_a_sqlite_database_is_upgraded_and_restored(past: Path, tmp_path: Path) -> None:
    var = tmp_path / "var"
    old, new = Console(past, var), Console(REPOSITORY, var)
    before = filled(old)
    assert len(before["log"]) == 8
    assert "lacks" in new.run("manage.py", "setup_code", status=1)

    said = new.run("manage.py", "upgrade")
    assert new.said("past.py") == before
    assert_works(new)
    new_database(tmp_path / "fresh.sqlite3")
    assert schema(var / "fleet.sqlite3") == schema(tmp_path / "fresh.sqlite3")

    [backup] = re.findall(r"\S+\.sqlite3", said)
    for left in var.glob("fleet.sqlite3*"):
        left.unlink()
    shutil.copy(backup, var / "fleet.sqlite3")
    assert old.said("past.py") == before
    old.run("manage.py", "migrate", "--check", "--skip-checks")


def test_a_postgresql_database_is_upgraded_and_restored(tmp_path: Path) -> None:
    with postgresql() as url:
        past = code_of(PAST["2026-11-22"], tmp_path)
        old, new = (Console(code, tmp_path / "var", FLEET_DATABASE_URL=url) for code in (past, REPOSITORY))
        before = filled(old)
        words = new.run("manage.py", "upgrade", status=1)
        assert "script/serve --migrate" in words
        [dump] = re.findall(r"^ +(pg_dump .*)$", words, re.MULTILINE)
        subprocess.run(dump.split(), cwd=tmp_path, check=True)
        upgrade_beside_others(new, url)
        assert new.said("past.py") == before
        assert_works(new)

        host = url.partition("host=")[2]
        restored = [
            "pg_restore",
            "--clean",
            "--if-exists",
            f"--host={host}",
            "--username=fleet",
            "--dbname=postgres",
        ]
        subprocess.run(
            ["psql", f"--host={host}", "--username=fleet", "--dbname=postgres", "-qc", EMPTY], check=True
        )
        subprocess.run([*restored, f"before-{version()}.dump"], cwd=tmp_path, check=True)
        assert old.said("past.py") == before


def upgrade_beside_others(console: Console, url: str) -> None:
    """Upgrade: not while a supervisor of another computer runs, and after another computer's upgrade."""
    with psycopg.connect(url, application_name="fleet supervisor on lab2, process 7"):
        assert "(lab2, process 7)" in console.run("manage.py", "upgrade", "--migrate", status=1)
    command = [sys.executable, "manage.py", "upgrade", "--migrate"]
    with psycopg.connect(url, autocommit=True) as other:
        other.execute("SELECT pg_advisory_lock(1)")
        upgrade = subprocess.Popen(
            command, cwd=console.code, env=console.environment, stderr=subprocess.PIPE, text=True
        )
        locks = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
        until(lambda: other.execute(locks).fetchone() == (1,), "the upgrade waits")
    said = upgrade.communicate()[1]
    assert (upgrade.returncode, said) == (
        0,
        "Another computer upgrades this database: waiting until it has ended.\n",
    )


INVITATIONS = """
import django; django.setup()
from datetime import date
from django.utils import timezone
from django.db import connection
from django.db.migrations.executor import MigrationExecutor
apps = MigrationExecutor(connection).loader.project_state(("access", "0001_initial")).apps
day, now = date(2026, 11, 23), timezone.now()
course = apps.get_model("access", "Course").objects.create(name="A", slug="a", starts_on=day, ends_on=day)
for _ in range(2):
    apps.get_model("access", "Invitation").objects.create(course=course, expires_at=now, most_uses=9)
"""


CODES = """
import django; django.setup()
from robots.access.models import Invitation
print(*{invitation.code for invitation in Invitation.objects.all()})
"""


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_a_new_column_has_a_value_for_each_row(kind: str, tmp_path: Path) -> None:
    """Two invitations have two codes: a default of a new column is the same for all rows."""
    with postgresql() if kind == "postgresql" else nullcontext("") as url:
        settings = {"FLEET_DATABASE_URL": url} if url else {}
        console = Console(REPOSITORY, tmp_path / "var", **settings)
        console.run("manage.py", "migrate", "access", "0001", "-v", "0", "--skip-checks")
        console.run("-c", INVITATIONS)
        console.run("manage.py", "upgrade", "--migrate")
        codes = console.run("-c", CODES).split()
        assert len(codes) == 2


EMPTY = "DROP SCHEMA public CASCADE; CREATE SCHEMA public"
