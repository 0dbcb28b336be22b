"""The state file of a bridge: stop latch, highest fence and navigation's last goal survive a kill."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
from pathlib import Path
from typing import IO

import msgspec
from msgspec import Struct

from robots.shared import wire
from robots.shared.sentences import catalogued

log = logging.getLogger(__name__)


class SavedState(Struct, frozen=True):
    """Contents of the state file."""

    latched: bool
    by: str
    reason: str
    fence: int
    goal: str = ""  # id of navigation's goal, if the robot drives to it or may still do so


class AlreadyRunning(Exception):
    """Another process on this machine is this robot's bridge."""


class StateStore:
    """One robot's state file. A lost or damaged file counts as a pressed stop."""

    def __init__(self, directory: Path, robot_id: str) -> None:
        self._path = directory / f"{robot_id}.json"
        self._lock_path = directory / f"{robot_id}.lock"
        self._lock: IO[str] | None = None

    def lock(self) -> None:
        """Become the only bridge of this robot on this computer until the process ends.

        Raises AlreadyRunning.
        """
        self._lock_path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = self._lock_path.open("a")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            lock.close()
            raise AlreadyRunning(f"{self._lock_path} is held by another bridge") from error
        self._lock = lock

    def unlock(self) -> None:
        """Allow another process to become the bridge."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def load(self, last_fence: int) -> SavedState:
        """Read the saved state.

        `last_fence` is the highest fence in the database. If it is above 0, a missing file counts as a stop.
        """
        try:
            found = msgspec.json.decode(self._path.read_bytes(), type=SavedState)
        except FileNotFoundError:
            if last_fence == 0:
                return SavedState(False, "", "", 0)
            return SavedState(True, "", catalogued("the bridge’s state file is missing"), last_fence)
        except (OSError, msgspec.DecodeError, UnicodeError) as error:
            log.error("state file %s cannot be read: %s", self._path, error)
            return SavedState(True, "", catalogued("the bridge’s state file cannot be read"), last_fence)
        return msgspec.structs.replace(found, fence=max(found.fence, last_fence))

    def save(self, state: SavedState) -> None:
        """Write the state so that it survives a power cut.

        Raises OSError. If a pressed stop cannot be written, the file is deleted, which also counts as a stop.
        """
        fresh = self._path.with_suffix(".new")
        try:
            with fresh.open("wb") as file:
                file.write(wire.encode(state))
                file.flush()
                os.fsync(file.fileno())
            fresh.replace(self._path)
            _sync_folder(self._path.parent)
        except OSError:
            if state.latched:
                self._path.unlink(missing_ok=True)
            raise


def _sync_folder(folder: Path) -> None:
    """Write the folder's entries to disk: until then, a power cut may restore the old file.

    Some file systems (CIFS, shared folders of virtual machines) cannot do this. Control is granted
    nevertheless.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)
