"""Pictures of a robot to its viewers: each gets the newest when it has drawn the last, never a queue."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

log = logging.getLogger(__name__)

Send = Callable[[dict[str, Any]], Awaitable[None]]


ROUND_TRIPS = 40  # pictures whose way is kept: some four seconds
SHARE = 0.95
FULL_RATE_VIEWERS = (
    30  # onlookers who get every picture; of twice as many each gets every second one, and so on
)


class PictureViewer:
    """One page that looks. At most one picture is on its way to it, and none is kept for it."""

    def __init__(self, views: PictureFeed, send: Send) -> None:
        self.send = send
        self.shown = 0  # number of the last picture sent
        self.turn = views.admit(self)
        self.drives = False  # whoever drives gets every picture
        self.sent_s = 0.0
        self._round_trips: deque[float] = deque(maxlen=ROUND_TRIPS)
        self._views = views

    async def drawn(self) -> None:
        """The page has drawn the last picture: send the newest if it missed its turn, else in its turn."""
        self._round_trips.append(time.monotonic() - self.sent_s)
        if self._views.number - self.shown >= self._views.every or (
            self.drives and self._views.number > self.shown
        ):
            await self._views.show(self)
        else:
            self._views.ready.add(self)

    @property
    def delay_s(self) -> float | None:
        """How long a picture takes to be seen and answered, but for one in twenty; None before the first was drawn."""
        trips = sorted(self._round_trips)
        return trips[int(SHARE * (len(trips) - 1))] if trips else None

    def leave(self) -> None:
        """Look no more."""
        self._views.dismiss(self)


class PictureFeed:
    """The newest picture of one robot, and who is ready for the next.

    A picture is encoded once, by the bridge; all viewers are handed the same text. Sending never waits under
    Daphne, so one task serves them all. A crowd takes turns: what it costs stays the same however many they are.
    """

    def __init__(self) -> None:
        self.number = 0
        self.every = 1  # an onlooker's turn comes with every so many pictures
        self.ready: set[PictureViewer] = set()
        self._viewers: set[PictureViewer] = set()
        self._admitted = 0
        self._newest: dict[str, Any] = {}
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._hand_out())

    def admit(self, viewer: PictureViewer) -> int:
        """Let a viewer in, ready for its first picture. Returns its place in the turns."""
        self._viewers.add(viewer)
        self.ready.add(viewer)
        self._count()
        self._admitted += 1
        return self._admitted

    def dismiss(self, viewer: PictureViewer) -> None:
        """See a viewer out."""
        self._viewers.discard(viewer)
        self.ready.discard(viewer)
        self._count()

    def publish(self, raw: str) -> None:
        """Make `raw` the newest picture."""
        self.number += 1
        self._newest = {"type": "websocket.send", "text": raw}
        self._news.set()

    async def show(self, viewer: PictureViewer) -> None:
        """Send the newest picture to one viewer."""
        viewer.shown = self.number
        viewer.sent_s = time.monotonic()
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
            due = {viewer for viewer in self.ready if self._has_turn(viewer)}
            self.ready -= due
            for viewer in sorted(due, key=lambda viewer: not viewer.drives):
                try:
                    await self.show(viewer)
                except Exception:
                    log.exception("a picture was not sent")

    def _has_turn(self, viewer: PictureViewer) -> bool:
        if viewer.drives or self.number - viewer.shown > self.every:
            return True
        return (self.number + viewer.turn) % self.every == 0

    def _count(self) -> None:
        self.every = 1 + max(0, len(self._viewers) - 1) // FULL_RATE_VIEWERS
