"""Restore an archive into an empty place, or beside what is there."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

from django.conf import settings
from django.contrib.auth import get_user_model
from django.db import connection
from msgspec import Struct

from fleet.backup.archive.tar import opened
from fleet.backup.checking import Checked, require_fit, verified
from fleet.backup.contents import MESHES, SETTINGS, key_mark
from fleet.backup.databases import Database, database
from fleet.backup.errors import BackupError
from fleet.backup.workplace import workplace
from robots.shared.processes.one_supervisor import AlreadySupervised
from robots.supervisor.claims import sole_supervisor

STOP = "sudo systemctl stop fleet"


class Restored(Struct, frozen=True):
    """The result of a restore."""

    checked: Checked
    kept: str  # the name of the database that was there; blank: it had no people
    beside: Path | None  # the folder with settings and meshes of the archive
    same_key: bool


class Findings(BackupError):
    """The log of the backup is not as it was written."""

    def __init__(self, checked: Checked) -> None:
        super().__init__("The log of this backup is not as it was written. Nothing was restored.")
        self.checked = checked


def restore(path: Path, passphrase: Callable[[], str], *, replace: bool, despite_findings: bool) -> Restored:
    """Restore an archive. Until it is verified, nothing is changed.

    Raises `BackupError`, `OSError` or an error of the database.
    """
    console = database()
    stamp = f"{datetime.now(UTC):%Y-%m-%dT%H%M%SZ}"
    with ExitStack() as held:
        _require_rest(console, held)
        people = _people()
        if people and not replace:
            raise BackupError(
                f"The database is not empty (accounts: {people}). With --replace it is kept under another name, "
                "and the backup takes its place."
            )
        work = held.enter_context(workplace(console.folder))
        archive = held.enter_context(opened(path, passphrase))
        require_fit(archive.manifest, console)
        archive.extract(work)
        name = held.enter_context(console.restored(work / console.file))
        checked = verified(archive.manifest, work, name)
        if checked.findings and not despite_findings:
            raise Findings(checked)
        beside = _put_beside(work, Path(settings.FLEET_VAR) / f"restored-{stamp}")
        kept = console.take(name, stamp if people else None)
    return Restored(checked, kept, beside, archive.manifest.secret_key == key_mark())


def _require_rest(console: Database, held: ExitStack) -> None:
    """Raise `BackupError` if a process of the console runs; keep supervisors from starting."""
    try:
        held.enter_context(sole_supervisor())
    except AlreadySupervised as other:
        raise BackupError(f"The console runs ({other}). Stop it first: {STOP}") from other
    answering = [path.name for path in settings.FLEET_RUN_DIR.glob("*.sock") if _answers(path)]
    if answering or console.is_used():
        what = ", ".join(answering) or "another process uses the database"
        raise BackupError(f"The console runs ({what}). Stop it first: {STOP}")


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(1.0)
        try:
            client.connect(str(path))
        except OSError:  # what a killed process left
            return False
    return True


def _people() -> int:
    """Return the number of accounts in the database that is there. Raises `BackupError` for another's database."""
    table = get_user_model()._meta.db_table
    try:
        tables = connection.introspection.table_names()
        if table not in tables:
            if tables:
                raise BackupError(
                    f"FLEET_DATABASE_URL names a database with tables of something else, such as {tables[0]}: "
                    "name an empty one."
                )
            return 0
        with connection.cursor() as cursor:
            cursor.execute(f"SELECT count(*) FROM {connection.ops.quote_name(table)}")  # noqa: S608
            found: int = cursor.fetchone()[0]
            return found
    finally:
        connection.close()


def _put_beside(work: Path, folder: Path) -> Path | None:
    """Move settings and meshes of the archive into a new folder: a person says where they belong."""
    found = [work / name for name in (SETTINGS, MESHES) if (work / name).exists()]
    if not found:
        return None
    folder.mkdir(mode=0o700)
    for path in found:
        path.rename(folder / path.name)
    return folder
