"""The lock of the fleet supervisor: only one runs with a run directory, and others can ask whether it runs."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

FROZEN_S = 10.0  # without a beat: the supervisor is frozen
LOCK = "fleet.lock"  # in the run directory; the supervisor holds it
LOCK_TRIES = 5  # `supervised` may hold the lock for a moment
LOCK_TRY_S = 0.02


class AlreadySupervised(Exception):
    """Another supervisor is there; the text is its computer and process."""


@contextlib.contextmanager
def only_instance(path: Path) -> Iterator[None]:
    """Context: hold the lock file. Raises `AlreadySupervised`. The lock ends with the process at the latest."""
    with path.open("a+") as lock:
        if not _acquired(lock):
            lock.seek(0)
            raise AlreadySupervised(f"this computer, process {lock.read().strip()}")
        lock.truncate(0)
        lock.write(str(os.getpid()))
        lock.flush()
        yield


def _acquired(lock: IO[str]) -> bool:
    for _ in range(LOCK_TRIES):
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        time.sleep(LOCK_TRY_S)
    return False


def forget(path: Path) -> None:
    """Empty the lock file if nobody holds it: this computer had a supervisor before, and is to have none now."""
    with contextlib.suppress(OSError), path.open("r+") as lock:
        if _acquired(lock):
            lock.truncate(0)


def forgotten(path: Path) -> bool:
    """Return whether no supervisor belongs to this computer."""
    return not path.exists() or path.stat().st_size == 0


def beat(path: Path) -> None:
    """Say that the holder of the lock file runs. Call it often. Does nothing without the file: a test holds none."""
    with contextlib.suppress(FileNotFoundError):
        os.utime(path)


def beat_age_s(path: Path) -> float:
    """Return the seconds since the last `beat`."""
    return time.time() - path.stat().st_mtime


def supervised(path: Path) -> bool:
    """Return whether a running supervisor holds this lock file. A file that a crashed one left does not count."""
    try:
        with path.open() as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
