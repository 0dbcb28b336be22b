"""Lets a process of its own cut the files in which erased people are, on the computer that has them.

As with `file_changes`, the database says so each minute, until it is done, and each bridge looks for the files in its
directory. Of several bridges on a computer one cuts a file, the others find that it is locked, or done.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from asyncio.subprocess import PIPE
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from uuid import UUID

import msgspec
from msgspec import structs

from robots.bridge.audit.records import Records
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.record_sink import FileCut

log = logging.getLogger(__name__)

COMMAND_LINE = (sys.executable, "-m", "robots.bridge.recorder.erasing")
EVERY_S = 60.0
FIRST_S = 10.0  # after the start of the bridge


class FileCuts:
    """The cuts of the files in the directory of one bridge, on the event loop, one at a time."""

    def __init__(self, config: BridgeConfig, records: Records, command: Sequence[str] = COMMAND_LINE) -> None:
        place = config.recordings
        self._directory = RecordingDirectory(Path(place.directory), place.quota_bytes) if place else None
        self._records = records
        self._command = command
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

        def found(cuts: list[FileCut]) -> None:
            with suppress(RuntimeError):  # the bridge has ended
                loop.call_soon_threadsafe(self._begin, cuts)

        self._records.recording_cuts(after, found)

    def _begin(self, cuts: list[FileCut]) -> None:
        if cuts:
            self._works = asyncio.ensure_future(self._carry_out(cuts))

    async def _carry_out(self, cuts: list[FileCut]) -> None:
        assert self._directory is not None  # noqa: S101  (see `tick`)
        try:
            here = await asyncio.to_thread(self._directory.recordings)
        except OSError:  # nothing was recorded here yet, or the disk is gone
            return
        for cut in cuts:
            if cut.taken.recording in here:
                taken = structs.replace(cut.taken, directory=str(self._directory.path))
                await self._carry_out_one(structs.replace(cut, taken=taken))
        self._ask(cuts[-1].taken.recording)

    async def _carry_out_one(self, cut: FileCut) -> None:
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

    def close(self) -> None:
        """End the process: its work is repeated."""
        if self._works is not None:
            self._works.cancel()
