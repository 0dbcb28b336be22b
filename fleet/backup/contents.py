"""The parts of an archive besides the database: its manifest, heads of the log; settings and meshes if asked."""

from __future__ import annotations

import hashlib
import os
import shlex
import socket
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path

import msgspec
from django.conf import settings
from django.db import connection
from django.db.migrations.recorder import MigrationRecorder

from fleet.audit.integrity.verify import Head, heads
from fleet.backup.archive.tar import Entry, Manifest
from fleet.base import version

HEADS = "heads.jsonl"
SETTINGS = "settings"
MESHES = "meshes"
PASSPHRASE = "FLEET_BACKUP_PASSPHRASE"  # noqa: S105 - the name of a variable
_MESH_FILES = {".stl", ".dae", ".obj", ".xml"}  # .xml: what makes a folder a package


def host() -> str:
    """Return this computer's name."""
    return socket.gethostname().split(".")[0] or "console"


def manifest(vendor: str, made_at: datetime) -> Manifest:
    """Return what the archive of the console's database is."""
    return Manifest(
        version=version.version(),
        commit=version.commit(),
        made_at=made_at,
        host=host(),
        database=vendor,
        migrations=sorted(
            f"{app}.{name}" for app, name in MigrationRecorder(connection).applied_migrations()
        ),
        secret_key=key_mark(),
    )


def console_mark() -> str:
    """Return a mark that tells consoles apart which back up into one folder, such as two in containers of one name."""
    known = connection.settings_dict
    database = [str(known[part]) for part in ("HOST", "PORT", "NAME")]
    return hashlib.sha256("\n".join([key_mark(), *database]).encode()).hexdigest()[:8]


def key_mark() -> str:
    """Return a mark by which the secret key is recognised."""
    return hashlib.sha256(b"fleet backup" + settings.SECRET_KEY.encode()).hexdigest()[:16]


def log_heads() -> Entry:
    """Return the heads of the log's chains, as `verify_audit --heads` writes them."""
    return Entry(HEADS, b"".join(msgspec.json.encode(head) + b"\n" for head in heads()))


def heads_in(folder: Path) -> list[Head]:
    """Return the heads of an archive that was extracted into the folder."""
    return [msgspec.json.decode(line, type=Head) for line in (folder / HEADS).read_bytes().splitlines()]


def settings_of(environment: Mapping[str, str] = os.environ) -> Iterator[Entry]:
    """Return the settings with the secret key as a file for systemd, and the files that they name."""
    own = {name: value for name, value in sorted(environment.items()) if name.startswith("FLEET_")}
    own.pop(PASSPHRASE, None)
    lines = [f"{name}={shlex.quote(value)}\n" for name, value in own.items()]
    yield Entry(f"{SETTINGS}/fleet.env", "".join(lines).encode())
    for name in ("FLEET_LINK_CA", "FLEET_LINK_CERT", "FLEET_LINK_KEY", "FLEET_S3_SECRET_FILE"):
        if value := own.get(name, "").strip():
            yield Entry(f"{SETTINGS}/{name}", Path(value))


def meshes_of(folders: list[Path]) -> Iterator[Entry]:
    """Return the meshes in these folders of ROS packages; each folder gets a number."""
    for number, folder in enumerate(folders, 1):
        for path in sorted(folder.rglob("*")):
            if path.suffix.lower() in _MESH_FILES and path.is_file():
                yield Entry(f"{MESHES}/{number}/{path.relative_to(folder)}", path)
