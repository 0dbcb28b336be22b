"""Background work of a connection, so that drive input never waits for it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

log = logging.getLogger(__name__)

# The event loop does not keep a task alive: without this reference, Python may delete a running task.
_running: set[asyncio.Task[None]] = set()


def run_in_background(work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
    """Run `work` to its end, even if the connection that started it is gone. Logs its errors."""
    task = asyncio.create_task(work)
    _running.add(task)
    task.add_done_callback(_done)
    return task


def _done(task: asyncio.Task[None]) -> None:
    _running.discard(task)
    if not task.cancelled() and (error := task.exception()):
        log.error("A background task failed.", exc_info=error)


class RequestQueue:
    """Slow requests of one connection. They run one after the other; drive input does not wait for them."""

    LONGEST = 8

    def __init__(self) -> None:
        self._queue: asyncio.Queue[Callable[[], Awaitable[None]]] = asyncio.Queue(self.LONGEST)
        self._task = asyncio.create_task(self._run())

    def add(self, request: Callable[[], Awaitable[None]]) -> bool:
        """Queue a coroutine function without arguments. Return False if the queue is full."""
        try:
            self._queue.put_nowait(request)
        except asyncio.QueueFull:
            return False
        return True

    def close(self) -> None:
        """Drop the queued requests and cancel the running one."""
        self._task.cancel()

    async def _run(self) -> None:
        while True:
            request = await self._queue.get()
            try:
                await request()
            except Exception:
                log.exception("A request of a connection failed.")
