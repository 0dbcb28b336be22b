"""A file that keeps a stop across a restart of the watchdog, until a bridge has latched it."""

from __future__ import annotations

import logging
import os
import threading
from pathlib import Path
from uuid import UUID

import msgspec

from robots.bridge.lease.state_store import StateStore
from robots.bridge.watchdog.rules import Heartbeat, StopPress
from robots.shared import wire

log = logging.getLogger(__name__)


class StopFile:
    """Writes on its own thread, so that a hanging disk cannot delay zeros."""

    def __init__(self, state_dir: str, robot_id: UUID) -> None:
        self._path = Path(state_dir) / f"{robot_id.hex[:12]}.pressed"
        self._bridge = StateStore(Path(state_dir), str(robot_id))
        self._newest: StopPress | None = None
        self._news = threading.Event()

    def load(self) -> StopPress | None:
        """Return the stop that the last watchdog left, if any. A damaged file counts as a stop."""
        try:
            self._newest = msgspec.json.decode(self._path.read_bytes(), type=StopPress)
        except FileNotFoundError:
            return None
        except (OSError, msgspec.DecodeError, UnicodeError) as error:
            log.error("%s cannot be read: %s", self._path, error)
            self._newest = StopPress(1, "somebody", "the file of this stop is damaged")
        return self._newest

    def before(self) -> Heartbeat:
        """Return the bridge's state from its state file. The bridge already has a stop of this file."""
        left = self._bridge.load(0)
        return Heartbeat(latched=left.latched, by=left.by, reason=left.reason)

    def start(self) -> None:
        threading.Thread(target=self._write, name="kept", daemon=True).start()

    def keep(self, press: StopPress | None) -> None:
        """Write this stop, or None for no stop. Returns at once."""
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
                log.error("writing a stop failed: %s", error)

    def _write_one(self, press: StopPress | None) -> None:
        if press is None:
            self._path.unlink(missing_ok=True)
            return
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        fresh = self._path.with_suffix(".new-press")
        with fresh.open("wb") as file:
            file.write(wire.encode(press))
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(self._path)
