"""Make a backup while everything runs, and remove old ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from django.conf import settings
from msgspec import Struct

from fleet.backup.archive.tar import Entry, write
from fleet.backup.archive.whole_files import PART, durable
from fleet.backup.contents import console_mark, host, log_heads, manifest, meshes_of, settings_of
from fleet.backup.databases import database
from fleet.backup.workplace import workplace


class Wishes(Struct, frozen=True):
    """The parts of a backup besides the database, and the passphrase that encrypts it."""

    settings: bool = False
    meshes: bool = False
    passphrase: str | None = None


class Made(NamedTuple):
    """A backup."""

    path: Path
    size: int  # bytes


def backup_make(target: Path, wishes: Wishes) -> Made:
    """Write one archive, whole or not at all: this file, or a new one in this folder.

    Raises `BackupError`, `OSError` or an error of the database.
    """
    console, now = database(), datetime.now(UTC)
    with workplace(console.folder) as work:
        path = target
        if target.is_dir():
            path = target / _name(now, encrypted=bool(wishes.passphrase))
            for left in target.glob(f"{_prefix()}*{PART}"):
                left.unlink()  # of a backup that was killed
        about, heads = (
            manifest(console.vendor, now),
            log_heads(),
        )  # the copy has these records, and later ones
        copy = work / console.file
        console.copy_to(copy)
        with durable(path) as part, part.open("xb") as file:
            write(file, about, _entries(Entry(console.file, copy), heads, wishes), wishes.passphrase)
    return Made(path, path.stat().st_size)


def _entries(copy: Entry, heads: Entry, wishes: Wishes) -> Iterator[Entry]:
    yield heads
    yield copy
    if wishes.settings:
        yield from settings_of()
    if wishes.meshes:
        yield from meshes_of(settings.FLEET_MESHES)


def forget_old(folder: Path, keep: int) -> list[Path]:
    """Remove the archives of this console in the folder, except the newest. Return those that are gone."""
    named = re.compile(re.escape(_prefix()) + r"\d{4}-\d\d-\d\dT\d{6}Z\.tar\.gz(\.age)?")
    found = sorted(path for path in folder.iterdir() if named.fullmatch(path.name))
    old = found[: max(0, len(found) - keep)]
    for path in old:
        path.unlink()
    return old


def _prefix() -> str:
    return f"fleet-{host()}-{console_mark()}-"


def _name(at: datetime, *, encrypted: bool) -> str:
    return f"{_prefix()}{at:%Y-%m-%dT%H%M%SZ}.tar.gz{'.age' if encrypted else ''}"
