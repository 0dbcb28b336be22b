"""Viewers of the MJPEG baseline without a browser: each reads the stream and counts its pictures."""

from __future__ import annotations

import asyncio
import re
from contextlib import suppress
from types import TracebackType

_LENGTH = re.compile(rb"Content-Length: (\d+)")
_END_OF_HEAD = b"\r\n\r\n"


class MjpegCrowd:
    """Context: `count` viewers of the stream on this port; with `one_stalls` the last one reads nothing."""

    def __init__(self, port: int, count: int, *, one_stalls: bool = False) -> None:
        self._port = port
        self._one_stalls = one_stalls
        self.seen = [0] * count  # pictures by viewer
        self._writers: list[asyncio.StreamWriter] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> MjpegCrowd:
        for number in range(len(self.seen)):
            reader, writer = await asyncio.open_connection("127.0.0.1", self._port, limit=1024)
            writer.write(b"GET /stream HTTP/1.1\r\nHost: bench\r\n\r\n")
            self._writers.append(writer)
            if not (self._one_stalls and number == len(self.seen) - 1):
                self._tasks.append(asyncio.create_task(self._watch(number, reader)))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for writer in self._writers:
            writer.transport.abort()

    async def _watch(self, number: int, reader: asyncio.StreamReader) -> None:
        with suppress(asyncio.IncompleteReadError):
            while True:
                head = await reader.readuntil(_END_OF_HEAD)
                if length := _LENGTH.search(head):
                    await reader.readexactly(int(length[1]))
                    self.seen[number] += 1
