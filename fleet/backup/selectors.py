"""The last backup and the last check, from the log."""

from __future__ import annotations

from datetime import datetime

from msgspec import Struct

from fleet.audit.models import Record

DONE, FAILED = "done", "failed"  # outcomes


class LastBackup(Struct, frozen=True):
    """The newest backup, and the newest check of one that found nothing wrong. None: there was none."""

    at: datetime | None
    archive: str
    size: int  # bytes
    checked_at: datetime | None
    failed_at: datetime | None  # the newest try failed


def last_backup() -> LastBackup:
    """Return the last backup."""
    made, checked = _newest("backup.make", outcome=DONE), _newest("backup.check", outcome=DONE)
    tried = _newest("backup.make")
    parameters = made.parameters if made else {}
    return LastBackup(
        at=made.at if made else None,
        archive=str(parameters.get("archive", "")),
        size=int(parameters.get("bytes", 0)),
        checked_at=checked.at if checked else None,
        failed_at=tried.at if tried and tried.outcome != DONE else None,
    )


def _newest(kind: str, **more: str) -> Record | None:
    return Record.objects.filter(kind=kind, **more).order_by("-id").first()
