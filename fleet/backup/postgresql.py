"""A PostgreSQL database: its copies by pg_dump and pg_restore, and its place.

Its owner needs the right to make databases (CREATEDB) to check and restore; to copy, the right to read is enough.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psycopg
from django.conf import settings
from django.db import connection
from psycopg.conninfo import make_conninfo
from psycopg.sql import SQL, Composed, Identifier, Literal

from fleet.backup.errors import BackupError

RIGHT = "Let its owner make databases: ALTER ROLE {role} CREATEDB (as PostgreSQL's administrator)."


class Postgresql:
    """The console's database on its server."""

    vendor = "postgresql"
    file = "database.pgdump"

    def __init__(self) -> None:
        self._name: str = connection.settings_dict["NAME"]
        self.folder = Path(settings.FLEET_VAR)
        # Another computer may check its backups on this server meanwhile; this folder has one check at a time.
        place = f"{socket.gethostname()}\n{self.folder.resolve()}"
        self._beside = f"{self._name}_backup_{hashlib.sha256(place.encode()).hexdigest()[:8]}"

    def copy_to(self, file: Path) -> None:
        """Let pg_dump copy the database, not compressed: the archive is."""
        self._run("pg_dump", self._name, "--format=custom", "--compress=0", f"--file={file}")

    def is_used(self) -> bool:
        """Return whether another session is open."""
        others = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND pid <> pg_backend_pid()"
        connection.close()
        with connection.cursor() as cursor:
            cursor.execute(others)
            found: int = cursor.fetchone()[0]
        connection.close()
        return found > 0

    @contextmanager
    def restored(self, file: Path) -> Iterator[str]:
        """Let pg_restore fill a new database on the same server."""
        name = self._beside
        self._make(name)
        try:
            how = (
                "--exit-on-error",
                "--single-transaction",
                "--no-owner",
                "--no-privileges",
                "--no-comments",
            )
            self._run("pg_restore", name, *how, str(file))
            yield name
        finally:
            self._execute(self._name, _dropped(name))

    def take(self, name: str, stamp: str | None) -> str:
        """Exchange the names of both databases, in one transaction: at each moment one of them is the console's.

        No session may rename its own database, so a third one is made for that moment.
        """
        connection.close()
        kept = f"{self._name}_before_{stamp or 'restore'}"
        third = f"{self._beside}_names"
        self._make(third)
        try:
            with self._session(third) as session, session.transaction():
                session.execute(_renamed(self._name, kept))
                session.execute(_renamed(name, self._name))
        except psycopg.Error as error:
            raise BackupError(
                f"The databases could not exchange their names: {error} "
                f"If there is a database {kept} now, the restore is done; else nothing was changed."
            ) from error
        finally:
            with suppress(psycopg.Error):  # the next restore removes it, too
                self._execute(self._name, _dropped(third))
        if stamp:
            return kept
        self._execute(self._name, _dropped(kept))
        return ""

    def _make(self, name: str) -> None:
        """Make an empty database with the encoding and the order of texts of the console's."""
        like = (
            "SELECT pg_encoding_to_char(encoding), datcollate, datctype FROM pg_database WHERE datname = %s"
        )
        with self._session(self._name) as session:
            found = session.execute(like, [self._name]).fetchone() or ()
            made = SQL("CREATE DATABASE {} TEMPLATE template0 ENCODING {} LC_COLLATE {} LC_CTYPE {}")
            try:
                session.execute(_dropped(name))
                session.execute(made.format(Identifier(name), *map(Literal, found)))
            except psycopg.errors.InsufficientPrivilege as error:
                role = connection.settings_dict["USER"]
                raise BackupError(f"A new database cannot be made. {RIGHT.format(role=role)}") from error

    def _execute(self, name: str, statement: Composed) -> None:
        with self._session(name) as session:
            session.execute(statement)

    def _session(self, name: str) -> psycopg.Connection[tuple[Any, ...]]:
        return psycopg.connect(self._address(name), autocommit=True, password=self._password)

    @property
    def _password(self) -> str | None:
        return connection.settings_dict["PASSWORD"] or None

    def _address(self, name: str) -> str:
        """Return how programs reach a database of the server; the password is not in it."""
        known = connection.settings_dict
        parts = {"host": known["HOST"], "port": known["PORT"], "user": known["USER"]}
        given = {key: value for key, value in parts.items() if value}
        # The console's limits of a query are not for these.
        options = {key: value for key, value in known["OPTIONS"].items() if key != "options"}
        return make_conninfo("", **given, **options, dbname=name)

    def _run(self, program: str, name: str, *words: str) -> None:
        """Run a program of PostgreSQL. Its list of words, which others may see, has no password."""
        found = shutil.which(program)
        if found is None:
            raise BackupError(f"{program} is not installed. Run: apt install postgresql-client")
        own = {"PGPASSWORD": self._password} if self._password else {}
        command = [found, f"--dbname={self._address(name)}", *words]
        done = subprocess.run(command, env=os.environ | own, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            raise BackupError(f"{program} failed: {done.stderr.strip()}")


def _renamed(old: str, new: str) -> Composed:
    return SQL("ALTER DATABASE {} RENAME TO {}").format(Identifier(old), Identifier(new))


def _dropped(name: str) -> Composed:
    return SQL("DROP DATABASE IF EXISTS {}").format(Identifier(name))
