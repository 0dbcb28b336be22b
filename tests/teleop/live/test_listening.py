"""The shared reader of pages that only listen."""

from __future__ import annotations

import asyncio
from typing import Any

from teleop.live.consumers.listening import SharedReader


class _Faulty(SharedReader[Any]):
    check_s = 0.0
    failed = "Pages hear nothing now"

    def begin(self) -> None:
        self.looks = 0
        self.done = asyncio.Event()

    async def look(self) -> None:
        self.looks += 1
        if self.looks == 1:
            raise RuntimeError("a fault")
        self.done.set()


async def test_a_fault_does_not_end_the_reader() -> None:
    reader, page = _Faulty(), object()
    reader.join(page)
    await asyncio.wait_for(reader.done.wait(), 5.0)
    reader.leave(page)
