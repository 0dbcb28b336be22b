"""The WebSocket of calendars and lessons: a hint whenever a booking, a policy, a holiday or a turn changed.

The hint contains no details: the page then reads the bookings again that its person may see. The audit log
contains the changes of all processes. One reader checks it for all calendars of this web process.
"""

from __future__ import annotations

from robots.shared import wire
from teleop.background.database import in_database
from teleop.live.consumers.listening import ListeningSocket, SharedReader
from teleop.webhooks.event_reader import lines_after, newest_record

KINDS = ("booking.", "policy.", "holiday.", "robot.out_of_service", "robot.back_in_service")
TURNS = ("turn.", "control.take", "control.hand_over", "control.end", "fault")  # also "control.take_over"


class BookingsConsumer(ListeningSocket):
    """One calendar. It gets a hint about `check_s` after a change, and one hint when it opens."""

    async def on_open(self) -> None:
        await self.send_message(wire.BookingsChanged())
        _reader.join(self)

    async def on_close(self) -> None:
        _reader.leave(self)


class _Reader(SharedReader[BookingsConsumer]):
    check_s = 0.4
    failed = "Calendars get no hints of changes now"

    def begin(self) -> None:
        self._read_to: int | None = None

    async def look(self) -> None:
        if self._read_to is None:
            self._read_to = await in_database(newest_record)
            await self._tell()  # there may have been changes before this
        lines = await in_database(lines_after, self._read_to)
        self._read_to = lines[-1].pk if lines else self._read_to
        kinds = [line.kind for line in lines]
        if any(kind.startswith(KINDS) for kind in kinds):
            await self._tell()
        elif any(kind.startswith(TURNS) for kind in kinds):
            await self._tell(turns=True)

    async def _tell(self, *, turns: bool = False) -> None:
        for page in list(self.pages):
            await page.send_message(wire.BookingsChanged(turns))


_reader = _Reader()
