"""The WebSocket of calendars and lessons: a hint whenever a booking, a policy, a holiday or a turn changed.

The hint contains no details: the page then reads the bookings again that its person may see. The audit log
contains the changes of all processes. One reader checks it for all calendars of this web process.
"""

from __future__ import annotations

import asyncio
import logging

from django.db import DatabaseError

from robots.shared import wire
from robots.shared.wire import Refusal, fleet_message
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import MessageSocket
from teleop.webhooks.event_reader import lines_after, newest_record

log = logging.getLogger(__name__)

CHECK_S = 0.4
KINDS = ("booking.", "policy.", "holiday.", "robot.out_of_service", "robot.back_in_service")
TURNS = ("turn.", "control.take", "control.hand_over", "control.end", "fault")  # also "control.take_over"


class BookingsConsumer(MessageSocket):
    """One calendar. It gets a hint about `CHECK_S` after a change, and one hint when it opens."""

    async def on_open(self) -> None:
        await self.send_message(wire.BookingsChanged())
        _reader.join(self)

    async def on_close(self) -> None:
        _reader.leave(self)

    async def on_message(self, raw: str) -> None:
        match fleet_message(raw):
            case wire.Ping(sent_ms=sent_ms):
                if await self.within_budget("ping"):
                    await self.send_message(wire.Pong(sent_ms))

    def refused_request(self, of: str, refusal: Refusal) -> None:
        """Record nothing: no message asks for anything."""


class _Reader:
    """Reads the audit log while a calendar is open."""

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
                    await self._tell()  # there may have been changes before this
                lines = await in_database(lines_after, read_to)
            except DatabaseError as error:
                log.warning("Calendars get no hints of changes now: %s", error)
            else:
                read_to = lines[-1].pk if lines else read_to
                kinds = [line.kind for line in lines]
                if any(kind.startswith(KINDS) for kind in kinds):
                    await self._tell()
                elif any(kind.startswith(TURNS) for kind in kinds):
                    await self._tell(turns=True)
            await asyncio.sleep(CHECK_S)

    async def _tell(self, *, turns: bool = False) -> None:
        for listener in list(self._listeners):
            await listener.send_message(wire.BookingsChanged(turns))


_reader = _Reader()
