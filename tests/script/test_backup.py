"""`manage.py backup` and `manage.py restore` with a real PostgreSQL, as an owner without other rights."""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest

from script.stack.places import REPOSITORY
from tests.processes import outside
from tests.script.servers import postgresql, postgresql_installed

pytestmark = pytest.mark.skipif(not postgresql_installed(), reason="no PostgreSQL here")
HALF_WAY = """
from django.core.management import call_command
from fleet.backup import postgresql
renamed = postgresql._renamed
postgresql._renamed = lambda old, new: renamed("none" if new == "other" else old, new)
call_command("restore", "{archive}", "--replace")
"""
# Another computer checks the archive while this one does.
MEANWHILE = """
import os, subprocess, sys
from django.core.management import call_command
from fleet.backup import checking
verified = checking.verified
def after_another(*words):
    command = [sys.executable, "manage.py", "backup", "--check", "{archive}"]
    subprocess.run(command, env=os.environ | {{"FLEET_VAR": "{other}"}}, check=True)
    return verified(*words)
checking.verified = after_another
call_command("backup", "--check", "{archive}")
"""
PASSPHRASE = "correct horse battery staple"


class Console:
    """The commands of a console with this database."""

    def __init__(self, server: str, database: str, role: str, var: Path) -> None:
        self._server, self._name = server, database
        var.mkdir(mode=0o700)
        self._environment = outside() | {
            "FLEET_VAR": str(var),
            "FLEET_HOSTS": "localhost",
            "FLEET_SECRET_KEY": "a key for tests, which protects nothing at all",
            "FLEET_DATABASE_URL": server.replace("fleet@/postgres", f"{role}:secret@/{database}"),
            "FLEET_BACKUP_PASSPHRASE": PASSPHRASE,
        }

    def run(self, *words: Any, status: int = 0) -> str:
        """Run a command of manage.py; return what it says."""
        command = [sys.executable, "manage.py", *map(str, words)]
        done = subprocess.run(command, cwd=REPOSITORY, env=self._environment, capture_output=True, text=True)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    def rows(self, statement: str) -> list[Any]:
        """Run a statement as the server's administrator."""
        with psycopg.connect(self._server, dbname=self._name, autocommit=True) as session:
            cursor = session.execute(statement)
            return [row[0] for row in cursor] if cursor.description else []


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgresql() as url, psycopg.connect(url, autocommit=True) as session:
        session.execute("CREATE ROLE lab LOGIN PASSWORD 'secret' CREATEDB")
        for name in ("fleet", "other"):
            session.execute(f"CREATE DATABASE {name} OWNER lab")
        yield url


def test_a_backup_of_postgresql_is_made_checked_and_restored(server: str, tmp_path: Path) -> None:
    console = Console(server, "fleet", "lab", tmp_path / "var")
    console.run("migrate", "--verbosity", "0")
    console.run("shell", "-c", "from fleet.accounts.models import User; User.objects.create_user('ada')")
    people = console.rows("SELECT username FROM accounts_user ORDER BY 1")
    with psycopg.connect(server, dbname="fleet") as writer:  # others go on meanwhile
        writer.execute("UPDATE accounts_user SET project = 'not committed'")
        archive = console.run("backup", tmp_path, "--verify").split(": ")[0]
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    meanwhile = MEANWHILE.format(archive=archive, other=tmp_path / "elsewhere")
    assert console.run("shell", "-c", meanwhile).count("all are as written") == 2
    new = Console(server, "other", "lab", tmp_path / "new")
    assert "all are as written" in new.run("restore", archive)
    assert new.rows("SELECT username FROM accounts_user ORDER BY 1") == people
    assert "all are as written" not in new.run("restore", archive, status=1)
    with psycopg.connect(server, dbname="other"):
        assert "The console runs" in new.run("restore", archive, "--replace", status=1)
    before = console.rows("SELECT datname FROM pg_database ORDER BY 1")
    assert "else nothing was changed" in new.run("shell", "-c", HALF_WAY.format(archive=archive), status=1)
    assert console.rows("SELECT datname FROM pg_database ORDER BY 1") == before
    new.run("restore", archive, "--replace")
    names = console.rows("SELECT datname FROM pg_database WHERE datname LIKE 'other%' ORDER BY 1")
    assert names[0] == "other" and names[1].startswith("other_before_") and len(names) == 2
    new.run("verify_audit")
    new.run("migrate", "--check")


def test_the_consoles_role_with_few_rights_backs_up(server: str, tmp_path: Path) -> None:
    owner = Console(server, "fleet", "lab", tmp_path / "owner")
    owner.run("migrate", "--verbosity", "0")
    page = (REPOSITORY / "docs/deployment.md").read_text()
    grants = re.findall(r"^    ((?:GRANT|REVOKE) .*)$", page, re.MULTILINE)
    owner.rows("CREATE ROLE fleet_app LOGIN")
    for grant in grants:
        owner.rows(grant)
    few = Console(server, "fleet", "fleet_app", tmp_path / "few")
    archive = few.run("backup", tmp_path).split(": ")[0]
    assert "ALTER ROLE fleet_app CREATEDB" in few.run("backup", "--check", archive, status=1)
    assert "all are as written" in owner.run("backup", "--check", archive)


@pytest.mark.skipif(shutil.which("age") is None, reason="no age here")
def test_age_and_tar_open_a_backup_without_the_console(server: str, tmp_path: Path) -> None:
    Console(server, "fleet", "lab", tmp_path / "var").run("migrate", "--verbosity", "0")
    archive = Console(server, "fleet", "lab", tmp_path / "again").run("backup", tmp_path).split(": ")[0]
    opened = tmp_path / "opened"
    opened.mkdir()
    child, terminal = pty.fork()  # age asks for passphrases in a terminal only
    if child == 0:
        os.execvp("age", ["age", "--decrypt", "--output", str(opened / "backup.tar.gz"), archive])  # noqa: S606
    assert b"passphrase" in os.read(terminal, 1000)
    os.write(terminal, f"{PASSPHRASE}\n".encode())
    assert os.waitpid(child, 0)[1] == 0
    os.close(terminal)
    for command in (["tar", "xzf", "backup.tar.gz"], ["sha256sum", "--check", "--quiet", "SHA256SUMS"]):
        subprocess.run(command, cwd=opened, check=True)
    assert (opened / "database.pgdump").read_bytes().startswith(b"PGDMP")
