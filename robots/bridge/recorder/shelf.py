"""``python -m robots.bridge.recorder.shelf``: hands out the files of recordings to web processes on other computers.

A web process names a recording by its id, never by a path. The process knows no ROS: it works while the robot is off.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections import deque
from pathlib import Path
from typing import BinaryIO

from websockets.asyncio.server import ServerConnection

from robots.bridge.recorder.files.directory import PICTURE, RecordingDirectory
from robots.bridge.robot_clock import RobotClock
from robots.bridge.served.process import Call, run
from robots.bridge.served.server import ProcessServer, WebProcess
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.wire import Refusal, ShelfPart, ShelfRead, WireError

log = logging.getLogger(__name__)

NICE = 10  # nobody drives by what it reads
MOST_BYTES = 256 * 1024 * 1024  # of memory
MOST_WAITING = 4  # requests of one connection: a reader waits for each answer

_FLOOD = Refusal("flood", "Too many requests wait.", "wire")
_NONE = wire.framed(ShelfPart(None), b"")


class _Reader(WebProcess):
    """One reader in a web process. It reads one file at a time."""

    def __init__(self, socket: ServerConnection, directory: RecordingDirectory | None) -> None:
        super().__init__(socket)
        self.began_s: float | None = None  # the read that goes on
        self._directory = directory
        self._waiting: deque[ShelfRead] = deque()
        self._file: BinaryIO | None = None
        self._which: tuple[object, ...] = ()  # recording and part of the open file

    def take(self, raw: str | bytes) -> None:
        if len(self._waiting) >= MOST_WAITING:
            raise WireError(_FLOOD)
        self._waiting.append(wire.shelf_request(raw))
        self.news.set()

    async def send_waiting(self) -> None:
        while self._waiting:
            self.began_s = time.monotonic()
            try:
                frame = await asyncio.to_thread(self._frame, self._waiting.popleft())
            finally:
                self.began_s = None
            await self.socket.send(frame)

    def _frame(self, asked: ShelfRead) -> bytes:
        try:
            number = self._opened(asked).fileno()
            content = os.pread(number, asked.size, asked.offset)
            return wire.framed(ShelfPart(os.fstat(number).st_size), content)
        except OSError as error:
            log.warning("recording %s cannot be read: %s", asked.recording, error)
            return _NONE

    def _opened(self, asked: ShelfRead) -> BinaryIO:
        wanted = asked.recording, asked.part
        if self._file is None or self._which != wanted:
            if self._directory is None:
                raise FileNotFoundError("recordings are switched off")
            path = self._directory.find(asked.recording)
            self._file = (path if asked.part == "file" else path.with_suffix(PICTURE)).open("rb")
            self._which = wanted
        return self._file


class Shelf(ProcessServer[_Reader]):
    """Accepts web processes. A disk that hangs stops its signs of life, so that the bridge starts another one."""

    ping_s = 10.0  # on a slow network an answer takes seconds, and an answer to a ping waits behind it

    def __init__(self, config: BridgeConfig) -> None:
        super().__init__("shelf", config.link)
        place = config.recordings
        self._directory = RecordingDirectory(Path(place.directory), place.quota_bytes) if place else None
        self.clock = RobotClock()

    @property
    def server(self) -> Shelf:
        return self

    @property
    def looked_s(self) -> float:
        """When the oldest read that goes on began; now, if none does."""
        begun = [reader.began_s for reader in self.processes if reader.began_s is not None]
        return min(begun, default=time.monotonic())

    def connected(self, socket: ServerConnection) -> _Reader:
        return _Reader(socket, self._directory)

    def left(self) -> None:
        """Nothing waits for those who left."""


def begin(config: BridgeConfig, _call: Call) -> Shelf:
    """Make the shelf; it is not started yet."""
    return Shelf(config)


if __name__ == "__main__":
    run("shelf", NICE, MOST_BYTES, begin)
