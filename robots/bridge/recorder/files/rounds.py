"""Asks the database each minute what must be done with files in this computer's directory.

The database says so until it is done, so a computer that was off does it later. It does not know which computer has a
file: each bridge asks for the work at the files of all robots, and does it at files that are here.
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar
from uuid import UUID

from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.shared.configuration.bridge_config import BridgeConfig

log = logging.getLogger(__name__)

EVERY_S = 60.0
W = TypeVar("W")


class Rounds(ABC, Generic[W]):
    """The rounds of one bridge, on the event loop, the first `first_s` after its start."""

    def __init__(self, config: BridgeConfig, first_s: float) -> None:
        place = config.recordings
        self._directory = (
            RecordingDirectory(Path(place.directory), place.quota_bytes, place.least_free_bytes)
            if place
            else None
        )
        self._first_s = first_s
        self._due_s: float | None = None
        self._works: asyncio.Task[None] | None = None

    @abstractmethod
    def ask(self, after: UUID | None, found: Callable[[list[W]], object]) -> None:
        """Ask for work at files whose ids follow this one. `found` is called on any thread."""

    @abstractmethod
    def recording_of(self, work: W) -> UUID:
        """Return the id of the file."""

    @abstractmethod
    async def carry_out(self, directory: RecordingDirectory, work: W) -> None:
        """Do it. Raises OSError: the rest waits for the next round."""

    def tick(self, now_s: float) -> None:
        """Ask, if it is time."""
        if self._directory is None:
            return
        if self._due_s is None:
            self._due_s = now_s + self._first_s
        if now_s >= self._due_s and (self._works is None or self._works.done()):
            self._due_s = now_s + EVERY_S
            self._ask(self._directory, None)

    def close(self) -> None:
        """End the work: it is repeated."""
        if self._works is not None:
            self._works.cancel()

    def _ask(self, directory: RecordingDirectory, after: UUID | None) -> None:
        loop = asyncio.get_running_loop()

        def found(work: list[W]) -> None:
            with suppress(RuntimeError):  # the bridge has ended
                loop.call_soon_threadsafe(begin, work)

        def begin(work: list[W]) -> None:
            if work:
                self._works = asyncio.ensure_future(self._carry_out(directory, work))

        self.ask(after, found)

    async def _carry_out(self, directory: RecordingDirectory, work: list[W]) -> None:
        try:
            here = await asyncio.to_thread(directory.recordings)  # a thread of its own: a disk may hang
            for one in work:
                if self.recording_of(one) in here:
                    await self.carry_out(directory, one)
        except FileNotFoundError:  # nothing was recorded here yet, or the disk is gone
            return
        except OSError as error:
            log.warning("not all work at files of recordings is done: %s", error)
            return
        self._ask(directory, self.recording_of(work[-1]))
