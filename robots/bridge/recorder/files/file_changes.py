"""Carries out on this computer what people decided about finished files: keep, let go, remove."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from uuid import UUID

from robots.bridge.audit.records import Records
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.recorder.files.rounds import Rounds
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.record_sink import FileChange

FIRST_S = 5.0  # after the start of the bridge


class FileChanges(Rounds[tuple[UUID, FileChange]]):
    """The changes for the files in the directory of one bridge."""

    def __init__(self, config: BridgeConfig, records: Records) -> None:
        super().__init__(config, FIRST_S)
        self._records = records

    def ask(self, after: UUID | None, found: Callable[[list[tuple[UUID, FileChange]]], object]) -> None:
        self._records.recording_changes(after, found)

    def recording_of(self, work: tuple[UUID, FileChange]) -> UUID:
        return work[0]

    async def carry_out(self, directory: RecordingDirectory, work: tuple[UUID, FileChange]) -> None:
        await asyncio.to_thread(_change, directory, *work)
        self._records.recording_changed(*work)


def _change(directory: RecordingDirectory, recording: UUID, change: FileChange) -> None:
    match change:
        case "remove":
            directory.remove(recording)
        case "keep":
            directory.keep(recording)
        case "let_go":
            directory.let_go(recording)
