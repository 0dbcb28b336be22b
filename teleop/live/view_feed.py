"""Views of a robot for its viewers.

A viewer gets the newest view after it acknowledged the previous one. Views are never queued.
"""

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

ROUND_TRIPS = 40  # the delay is computed from so many: about four seconds of views
DELAY_QUANTILE = 0.95
# Up to this number of viewers, each gets every view; with twice as many, each gets every second view, etc.
FULL_RATE_VIEWERS = 30


class Viewer:
    """One page that shows views of a robot. At most one view is unacknowledged, and no view is stored for a page."""

    def __init__(self, feed: ViewFeed, send: Send) -> None:
        self.send = send
        self.shown = 0  # number of the last view sent
        self.turn = feed.add(self)
        self.is_driver = False  # the driver gets every view
        self.sent_s = 0.0
        self._round_trips: deque[float] = deque(maxlen=ROUND_TRIPS)
        self._feed = feed

    async def acknowledge(self) -> None:
        """Note that the page has drawn its view. Send the newest at once if the page missed its turn."""
        self._round_trips.append(time.monotonic() - self.sent_s)
        if self._feed.number - self.shown >= self._feed.turn_length or (
            self.is_driver and self._feed.number > self.shown
        ):
            await self._feed.show(self)
        else:
            self._feed.ready.add(self)

    @property
    def delay_s(self) -> float | None:
        """Round trip time of a view in seconds, 95th percentile; None before the first acknowledgement."""
        trips = sorted(self._round_trips)
        return trips[int(DELAY_QUANTILE * (len(trips) - 1))] if trips else None

    def leave(self) -> None:
        """Send no more views."""
        self._feed.remove(self)


class ViewFeed:
    """The newest view of one robot, and the viewers that are ready for the next one.

    The bridge encodes a view once; all viewers get the same text. Under Daphne sending never waits, so one task
    serves all viewers. Many viewers take turns, so that the cost does not grow with their number.
    """

    def __init__(self) -> None:
        self.number = 0
        self.turn_length = 1  # a viewer that does not drive gets one of so many views
        self.ready: set[Viewer] = set()
        self._viewers: set[Viewer] = set()
        self._added = 0
        self._newest: dict[str, Any] = {}
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._keep_sending())

    def add(self, viewer: Viewer) -> int:
        """Add a viewer, ready for its first view. Returns its place in the turns."""
        self._viewers.add(viewer)
        self.ready.add(viewer)
        self._set_turn_length()
        self._added += 1
        return self._added

    def remove(self, viewer: Viewer) -> None:
        self._viewers.discard(viewer)
        self.ready.discard(viewer)
        self._set_turn_length()

    def publish(self, raw: str) -> None:
        """Make `raw` the newest view."""
        self.number += 1
        self._newest = {"type": "websocket.send", "text": raw}
        self._news.set()

    async def show(self, viewer: Viewer) -> None:
        viewer.shown = self.number
        viewer.sent_s = time.monotonic()
        with suppress(OSError):  # the connection is gone; its consumer detects this itself
            await viewer.send(self._newest)

    async def close(self) -> None:
        """Stop sending."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _keep_sending(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            due = {viewer for viewer in self.ready if self._has_turn(viewer)}
            self.ready -= due
            for viewer in sorted(due, key=lambda viewer: not viewer.is_driver):
                try:
                    await self.show(viewer)
                except Exception:
                    log.exception("A view was not sent.")

    def _has_turn(self, viewer: Viewer) -> bool:
        if viewer.is_driver or self.number - viewer.shown > self.turn_length:
            return True
        return (self.number + viewer.turn) % self.turn_length == 0

    def _set_turn_length(self) -> None:
        self.turn_length = 1 + max(0, len(self._viewers) - 1) // FULL_RATE_VIEWERS
