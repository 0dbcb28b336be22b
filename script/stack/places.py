"""Files that stay on the disk after a start, and checks whether their sources have changed since."""

from __future__ import annotations

import fcntl
import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
COLLECTED = REPOSITORY / "var" / "collected"  # static files, for all stacks


def private_file(path: Path, content: str) -> None:
    """Write a new file. Only its owner can read it, even while it is being written."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(content)


def kept_secret(path: Path) -> str:
    """Return a random secret that stays the same at each start, so that people stay signed in."""
    if not path.exists():
        private_file(path, secrets.token_urlsafe(50))
    return path.read_text()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Context: only one process at a time is in this block; others wait."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with path.open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


class Stamp:
    """Stores a digest of a build's sources, so that the build runs again only after a change."""

    def __init__(self, path: Path, sources: Iterable[Path]) -> None:
        self._path = path
        digest = hashlib.sha256()
        for source in sorted(sources):
            facts = source.stat()
            digest.update(f"{source}\0{facts.st_size}\0{facts.st_mtime_ns}\n".encode())
        self._digest = digest.hexdigest()

    @property
    def fits(self) -> bool:
        return self._path.exists() and self._path.read_text() == self._digest

    def unset(self) -> None:
        """Delete the digest when the build begins, so that an interrupted build runs again."""
        self._path.unlink(missing_ok=True)

    def set(self) -> None:
        self._path.write_text(self._digest)


def migration_sources() -> list[Path]:
    """Return the sources of the database's tables."""
    apps = [REPOSITORY / name for name in ("fleet", "robots", "teleop")]
    ours = [file for app in apps for file in app.rglob("migrations/*.py")]
    profiles = list((REPOSITORY / "robots/registry/profiles").glob("*.yaml"))
    return [*ours, *profiles, REPOSITORY / "requirements/web.txt"]


def static_sources() -> list[Path]:
    """Return the sources of collectstatic."""
    folders = [REPOSITORY / "static", REPOSITORY / "templates"]  # templates name the scripts that pages load
    files = [file for folder in folders for file in folder.rglob("*") if file.is_file()]
    others = ("package-lock.json", "requirements/web.txt", "fleet/settings.py", "fleet/site/static.py")
    return [*files, *(REPOSITORY / name for name in others)]
