"""Lets a process of its own cut the files in which erased people are, on the computer that has them.

Of several bridges on a computer one cuts a file, the others find that it is locked, or done.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from asyncio.subprocess import PIPE
from collections.abc import Callable, Sequence
from uuid import UUID

import msgspec
from msgspec import structs

from robots.bridge.audit.records import Records
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.recorder.files.rounds import Rounds
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.record_sink import FileCut

log = logging.getLogger(__name__)

COMMAND_LINE = (sys.executable, "-m", "robots.bridge.recorder.erasing")
FIRST_S = 10.0  # after the start of the bridge


class FileCuts(Rounds[FileCut]):
    """The cuts of the files in the directory of one bridge, one at a time."""

    def __init__(self, config: BridgeConfig, records: Records, command: Sequence[str] = COMMAND_LINE) -> None:
        super().__init__(config, FIRST_S)
        self._records = records
        self._command = command

    def ask(self, after: UUID | None, found: Callable[[list[FileCut]], object]) -> None:
        self._records.recording_cuts(after, found)

    def recording_of(self, work: FileCut) -> UUID:
        return work.taken.recording

    async def carry_out(self, directory: RecordingDirectory, work: FileCut) -> None:
        cut = structs.replace(work, taken=structs.replace(work.taken, directory=str(directory.path)))
        process = await asyncio.create_subprocess_exec(*self._command, stdin=PIPE, stdout=PIPE, stderr=PIPE)
        try:
            out, why = await process.communicate(msgspec.json.encode(cut))
        finally:
            if process.returncode is None:
                process.kill()
        if process.returncode:
            log.warning("the file %s is not cut yet: %s", cut.taken.name, why.decode().strip()[-300:])
        elif out:
            self._records.recording_cut(msgspec.json.decode(out, type=FileCut))
