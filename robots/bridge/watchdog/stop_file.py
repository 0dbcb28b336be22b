"""The file in which a stop survives its watchdog, until a bridge has latched it."""

from __future__ import annotations

import logging
import os
import threading
from pathlib import Path
from uuid import UUID

import msgspec

from robots.bridge.lease.state_store import StateStore
from robots.bridge.watchdog.rules import Heartbeat, StopPress

log = logging.getLogger(__name__)


class StopFile:
    """Written on a thread of its own: no disk that hangs holds up zeros."""

    def __init__(self, state_dir: str, robot_id: UUID) -> None:
        self._path = Path(state_dir) / f"{robot_id.hex[:12]}.pressed"
        self._bridge = StateStore(Path(state_dir), str(robot_id))
        self._newest: StopPress | None = None
        self._news = threading.Event()

    def load(self) -> StopPress | None:
        """The stop that the last watchdog left to a bridge, if any. A file that makes no sense is a stop as well."""
        try:
            self._newest = msgspec.json.decode(self._path.read_bytes(), type=StopPress)
        except FileNotFoundError:
            return None
        except (OSError, msgspec.DecodeError) as error:
            log.error("%s cannot be read: %s", self._path, error)
            self._newest = StopPress(1, "somebody", "the file of this stop is damaged")
        return self._newest

    def before(self) -> Heartbeat:
        """Read the bridge's state file: a stop that is already there needs no second report."""
        left = self._bridge.load(0)
        return Heartbeat(latched=left.latched, by=left.by, reason=left.reason)

    def start(self) -> None:
        """Begin to write."""
        threading.Thread(target=self._write, name="kept", daemon=True).start()

    def keep(self, press: StopPress | None) -> None:
        """Write this stop, or that there is none. Returns at once."""
        if press != self._newest:
            self._newest = press
            self._news.set()

    def _write(self) -> None:
        while True:
            self._news.wait()
            self._news.clear()
            newest = self._newest
            try:
                self._write_one(newest)
            except OSError as error:
                log.error("a stop was not written: %s", error)

    def _write_one(self, press: StopPress | None) -> None:
        if press is None:
            self._path.unlink(missing_ok=True)
            return
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        fresh = self._path.with_suffix(".new-press")
        with fresh.open("wb") as file:
            file.write(msgspec.json.encode(press))
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(self._path)
