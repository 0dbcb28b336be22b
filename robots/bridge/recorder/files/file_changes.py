"""Carries out on this computer what people decided about finished files: keep, let go, remove.

The database says so each minute, so a computer that was off does it later. It does not know which computer has a file:
each bridge asks for the changes of all robots, and carries out those of files that are here. A disk may hang: a
thread of its own waits.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from pathlib import Path
from uuid import UUID

from robots.bridge.audit.records import Records
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.record_sink import FileChange

log = logging.getLogger(__name__)

EVERY_S = 60.0
FIRST_S = 5.0  # after the start of the bridge


class FileChanges:
    """The changes for the files in the directory of one bridge, on the event loop."""

    def __init__(self, config: BridgeConfig, records: Records) -> None:
        place = config.recordings
        self._directory = (
            RecordingDirectory(Path(place.directory), place.quota_bytes, place.least_free_bytes)
            if place
            else None
        )
        self._records = records
        self._due_s: float | None = None
        self._works: asyncio.Task[None] | None = None

    def tick(self, now_s: float) -> None:
        """Ask, if it is time."""
        if self._directory is None:
            return
        if self._due_s is None:
            self._due_s = now_s + FIRST_S
        if now_s >= self._due_s and (self._works is None or self._works.done()):
            self._due_s = now_s + EVERY_S
            self._ask(None)

    def _ask(self, after: UUID | None) -> None:
        loop = asyncio.get_running_loop()

        def found(changes: list[tuple[UUID, FileChange]]) -> None:
            with suppress(RuntimeError):  # the bridge has ended
                loop.call_soon_threadsafe(self._begin, changes)

        self._records.recording_changes(after, found)

    def _begin(self, changes: list[tuple[UUID, FileChange]]) -> None:
        if changes:
            self._works = asyncio.ensure_future(self._carry_out(changes))

    async def _carry_out(self, changes: list[tuple[UUID, FileChange]]) -> None:
        assert self._directory is not None  # noqa: S101  (see `tick`)
        try:
            here = await asyncio.to_thread(self._directory.recordings)
            for recording, change in changes:
                if recording in here:
                    await asyncio.to_thread(_change, self._directory, recording, change)
                    self._records.recording_changed(recording, change)
        except FileNotFoundError:  # nothing was recorded here yet, or the disk is gone
            return
        except OSError as error:
            log.warning("files of recordings are not changed yet: %s", error)
            return
        self._ask(changes[-1][0])


def _change(directory: RecordingDirectory, recording: UUID, change: FileChange) -> None:
    match change:
        case "remove":
            directory.remove(recording)
        case "keep":
            directory.keep(recording)
        case "let_go":
            directory.let_go(recording)
