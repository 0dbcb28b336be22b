"""The WebSocket of the calendar: a hint whenever a booking, a policy or an out-of-service period changed.

The hint says no more: the page reads again what its person may see. All changes stand in the audit log, whichever
process made them; one reader looks there for all calendars of this web process.
"""

from __future__ import annotations

import asyncio
import logging

from django.db import DatabaseError

from robots import wire
from robots.wire import Refusal, fleet_message
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import MessageSocket
from teleop.webhooks.event_reader import lines_after, newest_record

log = logging.getLogger(__name__)

CHECK_S = 0.4
KINDS = ("booking.", "policy.", "robot.out_of_service", "robot.back_in_service")


class BookingsConsumer(MessageSocket):
    """One calendar. It hears of a change within `CHECK_S`, and once when it opens."""

    async def on_open(self) -> None:
        """Begin to listen."""
        await self.send_message(wire.BookingsChanged())
        _reader.join(self)

    async def on_close(self) -> None:
        """Listen no more."""
        _reader.leave(self)

    async def on_message(self, raw: str) -> None:
        """Answer pings."""
        match fleet_message(raw):
            case wire.Ping(sent_ms=sent_ms):
                if await self.within_budget("ping"):
                    await self.send_message(wire.Pong(sent_ms))

    def refused_request(self, of: str, refusal: Refusal) -> None:
        """Record nothing: no message asks for anything."""


class _Reader:
    """Looks into the log while anybody listens."""

    def __init__(self) -> None:
        self._listeners: set[BookingsConsumer] = set()
        self._looking: asyncio.Task[None] | None = None

    def join(self, listener: BookingsConsumer) -> None:
        self._listeners.add(listener)
        if self._looking is None:
            self._looking = run_in_background(self._look())

    def leave(self, listener: BookingsConsumer) -> None:
        self._listeners.discard(listener)
        if not self._listeners and self._looking is not None:
            self._looking.cancel()
            self._looking = None

    async def _look(self) -> None:
        read_to: int | None = None
        while True:
            try:
                if read_to is None:
                    read_to = await in_database(newest_record)
                    await self._tell()  # of what happened before this
                lines = await in_database(lines_after, read_to)
            except DatabaseError as error:
                log.warning("Calendars hear of no changes now: %s", error)
            else:
                read_to = lines[-1].pk if lines else read_to
                if any(line.kind.startswith(KINDS) for line in lines):
                    await self._tell()
            await asyncio.sleep(CHECK_S)

    async def _tell(self) -> None:
        for listener in list(self._listeners):
            await listener.send_message(wire.BookingsChanged())


_reader = _Reader()
