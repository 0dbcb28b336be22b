"""Check an archive: restore it beside the console's database, and verify its log."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from msgspec import Struct

from fleet.audit.integrity.verify import Finding, compare, verify_all
from fleet.backup.archive.tar import Manifest, opened
from fleet.backup.contents import heads_in
from fleet.backup.databases import Database, connected_to, database
from fleet.backup.errors import BackupError
from fleet.backup.workplace import workplace
from fleet.base import version
from fleet.base.database import schema


class Checked(Struct, frozen=True):
    """The result of a check."""

    manifest: Manifest
    missing: int  # migrations that the database needs
    records: int | None  # None: their log has to be migrated before it can be verified
    findings: list[Finding]


def backup_check(path: Path, passphrase: Callable[[], str]) -> Checked:
    """Check an archive. Nothing of it stays. Raises `BackupError`, `OSError` or an error of the database."""
    console = database()
    with workplace(console.folder) as work, opened(path, passphrase) as archive:
        require_fit(archive.manifest, console)
        archive.extract(work)
        with console.restored(work / console.file) as name:
            return verified(archive.manifest, work, name)


def require_fit(about: Manifest, console: Database) -> None:
    """Raise `BackupError` if this console cannot use the database of the archive."""
    if schema.newer_migrations(_applied(about)):
        made_by = about.version + (f" ({about.commit})" if about.commit else "")
        raise BackupError(
            f"The backup is of release {made_by}, which is newer than this console, {version.release()}. "
            f"Install {made_by} and restore with it."
        )
    if about.database != console.vendor:
        raise BackupError(
            f"The backup has a database of {about.database}, and FLEET_DATABASE_URL names one of {console.vendor}."
        )


def verified(about: Manifest, work: Path, name: str) -> Checked:
    """Verify the log of a restored database, and compare it with the heads of its archive."""
    missing = schema.missing_migrations(_applied(about))
    if any(app == "audit" for app, _ in missing):
        return Checked(about, len(missing), None, [])
    with connected_to(name):
        found = verify_all()
        findings = [*found.findings, *compare(heads_in(work))]
    return Checked(about, len(missing), found.records, findings)


def _applied(about: Manifest) -> set[tuple[str, str]]:
    return {(app, name) for app, _, name in (migration.partition(".") for migration in about.migrations)}
