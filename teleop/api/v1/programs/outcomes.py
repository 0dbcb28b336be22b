"""Wait for the outcomes of tasks.

One query of the log, several times a second, serves all requests that wait.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Collection
from contextlib import suppress

from django.db import DatabaseError

from fleet.audit.models import Record
from teleop.background.database import in_database

CHECK_S = 0.2
# Requests that wait at the same time; further ones are answered at once. A process takes 400 requests, 200 of
# one address.
MOST = 150
CALL_EVERY_S = 1.0


class Outcomes:
    """The tasks for whose outcomes requests wait, by their record numbers. Used on the event loop."""

    def __init__(self) -> None:
        self._waiting: defaultdict[int, set[asyncio.Event]] = defaultdict(set)
        self._looking: asyncio.Task[None] | None = None

    async def wait(self, number: int, seconds: float, each_second: Callable[[], object]) -> None:
        """Wait until the task has an outcome, or for this time. Call `each_second` every second during the wait."""
        if sum(map(len, self._waiting.values())) >= MOST:
            return
        over = asyncio.Event()
        self._waiting[number].add(over)
        if self._looking is None or self._looking.done():
            self._looking = asyncio.create_task(self._look())
        try:
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._call_each_second(over, each_second), seconds)
        finally:
            self._waiting[number].discard(over)
            if not self._waiting[number]:
                del self._waiting[number]

    async def _call_each_second(self, over: asyncio.Event, each_second: Callable[[], object]) -> None:
        while not over.is_set():
            each_second()
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(over.wait(), CALL_EVERY_S)

    async def _look(self) -> None:
        while self._waiting:
            await asyncio.sleep(CHECK_S)
            try:
                over = await in_database(_over, list(self._waiting))
            except DatabaseError:
                continue  # the requests are answered when their time is over, with the facts readable then
            for number in over:
                for event in self._waiting.get(number, ()):
                    event.set()


def _over(numbers: Collection[int]) -> list[int]:
    """Return the tasks whose outcome is in the log."""
    return list(Record.objects.filter(of__in=numbers).values_list("of_id", flat=True))


outcomes = Outcomes()
