"""Pictures of a robot to its viewers: each gets the newest when it has drawn the last, never a queue."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

Send = Callable[[dict[str, Any]], Awaitable[None]]


class Viewer:
    """One page that looks. At most one picture is on its way to it, and none is kept for it."""

    def __init__(self, views: Views, send: Send) -> None:
        self.send = send
        self.shown = 0  # number of the last picture sent
        self._views = views
        views.ready.add(self)

    async def drawn(self) -> None:
        """The page has drawn the last picture: send the newest at once, or as soon as there is one."""
        if self._views.number > self.shown:
            await self._views.show(self)
        else:
            self._views.ready.add(self)

    def leave(self) -> None:
        """Look no more."""
        self._views.ready.discard(self)


class Views:
    """The newest picture of one robot, and who is ready for the next.

    A picture is encoded once, by the bridge; all viewers are handed the same text. Sending never waits under
    Daphne, so one task serves them all.
    """

    def __init__(self) -> None:
        self.number = 0
        self.ready: set[Viewer] = set()
        self._newest: dict[str, Any] = {}
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._hand_out())

    def publish(self, raw: str) -> None:
        """Make `raw` the newest picture."""
        self.number += 1
        self._newest = {"type": "websocket.send", "text": raw}
        self._news.set()

    async def show(self, viewer: Viewer) -> None:
        """Send the newest picture to one viewer."""
        viewer.shown = self.number
        with suppress(OSError):  # it is gone; its own connection notices
            await viewer.send(self._newest)

    async def close(self) -> None:
        """Hand out no more."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _hand_out(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            ready, self.ready = self.ready, set()
            for viewer in ready:
                await self.show(viewer)
