"""Makes databases for temporary consoles, as copies of one: migrations take 4 s of processor time."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from script.stack.places import REPOSITORY, Stamp, kept_secret, locked, migration_sources

MIGRATED = REPOSITORY / "var" / "migrated"
NAME = "fleet.sqlite3"  # as in fleet/settings.py


def with_tables(directory: Path) -> None:
    """Put a migrated database into the new directory of a stack."""
    new_database(directory / NAME)
    Stamp(directory / "migrated", migration_sources()).set()


def new_database(path: Path) -> None:
    """Write an empty, migrated SQLite database to `path`."""
    with locked(MIGRATED / "lock"):
        built = Stamp(MIGRATED / "built", _sources())
        if not built.fits:
            built.unset()
            for old in MIGRATED.glob(f"{NAME}*"):
                old.unlink()
            _migrate()
            built.set()
        path.touch(0o600)
        with closing(sqlite3.connect(MIGRATED / NAME)) as source, closing(sqlite3.connect(path)) as target:
            target.execute("PRAGMA synchronous=OFF")
            source.backup(target)


def _migrate() -> None:
    own = {name: value for name, value in os.environ.items() if not name.startswith(("FLEET_", "DJANGO_"))}
    settings = {
        "FLEET_VAR": str(MIGRATED),
        "FLEET_SECRET_KEY": kept_secret(MIGRATED / "secret-key"),
        "FLEET_HOSTS": "localhost",
    }
    command = [sys.executable, "manage.py", "migrate", "--no-input", "--verbosity", "0"]
    subprocess.run(command, cwd=REPOSITORY, env={**own, **settings}, check=True)  # noqa: S603 - our own command


def _sources() -> list[Path]:
    """Return all modules of the apps, because migrations import triggers, constraints and defaults of models."""
    apps = [REPOSITORY / name for name in ("fleet", "robots", "teleop")]
    files = [file for app in apps for kind in ("*.py", "*.yaml") for file in app.rglob(kind)]
    return [*files, REPOSITORY / "requirements/web.txt"]
