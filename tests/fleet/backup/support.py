"""Consoles of tests of backups."""

from __future__ import annotations

import socket
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from fleet.backup.databases import connected_to
from script.stack.database import new_database


@contextmanager
def new_console(var: Path, settings: Any) -> Iterator[Path]:
    """Let this process work for a new console with this FLEET_VAR."""
    (var / "run").mkdir(parents=True)
    new_database(var / "fleet.sqlite3")
    own = settings.FLEET_VAR, settings.FLEET_RUN_DIR
    settings.FLEET_VAR, settings.FLEET_RUN_DIR = var, var / "run"
    with connected_to(str(var / "fleet.sqlite3")):
        yield var
    settings.FLEET_VAR, settings.FLEET_RUN_DIR = own


@contextmanager
def listening(path: Path) -> Iterator[None]:
    """A process that answers at a Unix socket."""
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        server.listen()
        yield


@contextmanager
def using(path: Path) -> Iterator[None]:
    """A connection to a database file that does nothing."""
    with closing(sqlite3.connect(path)) as other:
        other.execute("SELECT count(*) FROM sqlite_master").fetchone()
        yield
