"""``manage.py upgrade``: bring the database to this release. `script/serve` runs it at each start.

Nothing is changed before a backup was made, nor while data would stop a migration.
"""

from __future__ import annotations

import sqlite3
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.checks import Tags
from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.db import OperationalError, connection
from django.db.migrations.recorder import MigrationRecorder
from django.utils import timezone

from fleet.backup.sqlite import copy_database
from fleet.base.database import schema
from fleet.base.version import version
from robots.shared.processes.one_supervisor import AlreadySupervised
from robots.supervisor.claims import require_no_supervisor, sole_supervisor, sole_upgrade

KEPT = 5  # backups
PATIENCE_S = 60.0  # so that five starts take longer than the five minutes in which systemd counts them
STEP_S = 1.0
WAITING = "Another computer upgrades this database: waiting until it has ended."


class Command(BaseCommand):
    help = "Bring the database to this release, after a backup."
    requires_system_checks = []

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument(
            "--migrate", action="store_true", help="there is a backup of the PostgreSQL database"
        )
        parser.add_argument(
            "--check", action="store_true", help="change nothing: fail if there is something to do"
        )
        parser.add_argument(
            "--wait", action="store_true", help="wait a minute for PostgreSQL, whose computer may start later"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        """Refuse, or make a backup, and migrate. A new database needs neither."""
        if options["wait"] and connection.vendor == "postgresql":
            self._wait_for_database()
        if options["check"]:
            self._require(schema.trouble(connection))
            return
        with ExitStack() as held:
            held.enter_context(sole_upgrade(lambda: self.stderr.write(WAITING)))
            applied = MigrationRecorder(connection).applied_migrations()
            trouble = schema.trouble(connection)
            self._require(trouble if schema.newer_migrations(applied) else None)
            if trouble and applied:
                self._prepare(held, backed_up=options["migrate"])
            # Also without a new migration: it reads the profiles that came with the release.
            call_command("migrate", interactive=False, verbosity=0)
        forget_old(Path(settings.FLEET_VAR) / "backups")

    def _require(self, trouble: str | None) -> None:
        if trouble:
            raise CommandError(trouble)

    def _prepare(self, held: ExitStack, *, backed_up: bool) -> None:
        """Keep supervisors from starting, look at the data and make a backup. Raises CommandError."""
        try:
            held.enter_context(sole_supervisor())
            require_no_supervisor()
        except AlreadySupervised as other:
            raise CommandError(
                f"Nothing was changed: a supervisor of the console runs ({other}), and a new schema would stop it. "
                "Stop it first: sudo systemctl stop fleet (fleet-bridges on a bridge host)"
            ) from other
        self.check(tags=[Tags.database], databases=["default"])
        if connection.vendor == "sqlite":
            self.stdout.write(f"The database before the upgrade: {back_up(Path(settings.FLEET_VAR))}")
        elif not backed_up:
            raise CommandError(_how_to_back_up())

    def _wait_for_database(self) -> None:
        """Wait until the database lets this process in. Raises OperationalError when the time is over."""
        last_s = time.monotonic() + PATIENCE_S
        told = False
        while True:
            try:
                return connection.ensure_connection()
            except OperationalError as error:
                if time.monotonic() > last_s:
                    raise
                if not told:
                    self.stderr.write(
                        f"Waiting for the database, up to a minute: {' '.join(str(error).split())}"
                    )
                told = True
                time.sleep(STEP_S)


def back_up(var: Path) -> Path:
    """Copy the SQLite database. Return the path of the copy."""
    folder = var / "backups"
    folder.mkdir(mode=0o700, exist_ok=True)
    copy = folder / f"before-{version()}-{timezone.now():%Y%m%dT%H%M%SZ}.sqlite3"
    try:
        copy_database(Path(connection.settings_dict["NAME"]), copy)
    except (OSError, sqlite3.Error) as error:
        raise CommandError(
            f"Nothing was changed: the database cannot be copied to {copy}: {error}."
        ) from error
    return copy


def forget_old(folder: Path) -> None:
    """Keep the newest copies, and the oldest of this release: tries that failed may have made the others."""
    copies = sorted(folder.glob("before-*.sqlite3"), key=lambda one: one.stat().st_mtime)
    first = next((one for one in copies if one.name.startswith(f"before-{version()}-")), None)
    for old in copies[:-KEPT]:
        if old != first:
            old.unlink()


def _how_to_back_up() -> str:
    of = connection.settings_dict
    host = of["HOST"] or of["OPTIONS"].get("host")  # of a socket
    where = {"host": host, "port": of["PORT"], "username": of["USER"]}
    told = [f"--{name}={value}" for name, value in where.items() if value]
    line = " ".join(["pg_dump --format=custom", f"--file=before-{version()}.dump", *told, of["NAME"]])
    return (
        f"Release {version()} changes the database; it waits until you have a backup. Stop every process of the "
        f"console, run\n\n    {line}\n\nand then: sudo script/manage upgrade --migrate\n"
        "(without a service start this release once with: script/serve --migrate; docs/upgrade.md)."
    )
