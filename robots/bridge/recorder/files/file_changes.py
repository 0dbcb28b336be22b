"""Carries out on this computer what people decided about finished files: keep, let go, remove.

The database says so each minute, so a bridge that was off does it later. A disk may hang: a thread of its own waits.
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
    """The changes for the files of one robot, on the event loop."""

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
            loop = asyncio.get_running_loop()

            def found(changes: list[tuple[UUID, FileChange]]) -> None:
                with suppress(RuntimeError):  # the bridge has ended
                    loop.call_soon_threadsafe(self._begin, changes)

            self._records.recording_changes(found)

    def _begin(self, changes: list[tuple[UUID, FileChange]]) -> None:
        if changes:
            self._works = asyncio.ensure_future(self._carry_out(changes))

    async def _carry_out(self, changes: list[tuple[UUID, FileChange]]) -> None:
        assert self._directory is not None  # noqa: S101  (see `tick`)
        for recording, change in changes:
            try:
                await asyncio.to_thread(_change, self._directory, recording, change)
            except OSError as error:
                log.warning("the file of recording %s is not changed yet: %s", recording, error)
                return
            self._records.recording_changed(recording, change)


def _change(directory: RecordingDirectory, recording: UUID, change: FileChange) -> None:
    match change:
        case "remove":
            directory.remove(recording)
        case "keep":
            directory.keep(recording)
        case "let_go":
            directory.let_go(recording)
