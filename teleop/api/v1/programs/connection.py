"""One program's connection to one robot: the robot page's protocol, with an answer to each request."""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any
from uuid import UUID

import msgspec
from msgspec import Struct, structs
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.shared import wire
from robots.shared.sentences import say, standing_alone
from robots.shared.wire import Accepted, Booked, Control, NotDone, Offers, Refusal, Refused, kind_of

log = logging.getLogger(__name__)

ANSWER_S = 6.0  # a bridge that has not answered after 5 s counts as silent
OPEN_S = 5.0
PING_S = 0.5
# A program counts as present for this time after its last request. Without it, a drive by a distance ends.
PRESENT_S = 10.0
REFUSED_AT_ONCE_S = 0.2
REPEAT_S = 0.05  # between two drive messages
NEUTRAL_S = 0.15  # pause after a zero velocity, when the bridge demands neutral first

GONE = Refusal("connection_lost", "The connection to the robot's control ended: take control again.", "lease")
NOT_CONNECTED = Refusal("not_connected", "The robot's control was not reached: try again.", "lease")
_SILENT = Refusal("no_answer", "The server did not answer in time. Look at the robot's state.", "lease")
_NOT_YOURS = Refusal("no_lease", "This program does not have control: take it first.", "lease")

Wanted = Callable[[Any], bool]


def _is_in_line(control: Control) -> bool:
    """Return whether the program waits for control, or in the line of a lesson."""
    lesson = control.lesson
    return control.ahead is not None or (lesson is not None and (lesson.yours or lesson.place is not None))


# Which `Control` shows that a request was carried out. Requests of others also cause `Control` messages.
_CARRIED_OUT: dict[type, Callable[[Control], bool]] = {
    **dict.fromkeys((wire.Take, wire.TakeOver, wire.Renew), lambda control: control.state == "yours"),
    **dict.fromkeys((wire.Release, wire.HandOver), lambda control: control.state != "yours"),
    wire.Ask: lambda control: control.state == "yours" or _is_in_line(control),
    wire.AskCancel: lambda control: not _is_in_line(control),
}


class ProgramSignIn(Struct, frozen=True):
    """The sign-in of a program: the headers of its request, which are passed on unchanged."""

    key: str  # of the token, or of the session
    person: UUID
    headers: tuple[tuple[str, str], ...]
    host: str
    origin: str | None


class Velocity(Struct, frozen=True):
    """A velocity as in drive messages: fractions of the robot's limits."""

    x: float
    y: float
    w: float
    share: float


async def open_socket(path: str, address: str, sign_in: ProgramSignIn) -> ClientConnection:
    """Open a WebSocket of the web process that listens at the Unix socket `path`. Raises `NotDone`."""
    try:
        return await unix_connect(
            path,
            uri=f"ws://{sign_in.host}{address}",
            additional_headers=list(sign_in.headers),
            origin=sign_in.origin,
            open_timeout=OPEN_S,
            max_size=None,
            compression=None,
        )
    except (OSError, InvalidHandshake, TimeoutError) as error:
        log.warning("A program was not connected to %s: %s", address, error)
        raise NotDone(NOT_CONNECTED) from error


class ProgramConnection:
    """A WebSocket like that of a robot page, which this process keeps open for a program."""

    def __init__(self, socket: ClientConnection) -> None:
        self._control: Control | None = None
        self._control_s = 0.0  # when it was received
        self.offers: Offers | None = None
        self.used_s = time.monotonic()  # time of the program's last request
        self.starting: dict[str, threading.Lock] = {}  # by kind of task, held until its record is found
        self.cancelled_s: dict[str, float] = {}  # time of the newest cancel, by kind of task or limb
        self._socket = socket
        self._numbers = count(1)
        self._count = 0  # of messages received
        self._received: deque[tuple[int, Any]] = deque(maxlen=200)
        self._news = asyncio.Condition()
        self._newest_drive = 0
        self.is_open = True
        self._reading = asyncio.create_task(self._read())
        self._pinging = asyncio.create_task(self._ping())

    @classmethod
    async def open(cls, path: str, slug: str, sign_in: ProgramSignIn) -> ProgramConnection:
        """Connect to the web process. Raises `NotDone`."""
        connection = cls(await open_socket(path, f"/ws/robots/{slug}/", sign_in))
        try:
            await connection._ask(wire.Hello(secrets.token_urlsafe(24)), lambda one: isinstance(one, Control))
        except BaseException:
            await connection.close()
            raise
        return connection

    @property
    def control(self) -> Control | None:
        """Return control as received last, with the seconds that remain now; None: nothing received yet."""
        control, age_s = self._control, time.monotonic() - self._control_s
        if control is None:
            return None
        return structs.replace(
            control,
            remaining_s=_left(control.remaining_s, age_s),
            offer_s=_left(control.offer_s, age_s),
            booked=_aged(control.booked, age_s),
            next_booked=_aged(control.next_booked, age_s),
            out_s=_left(control.out_s, age_s),
        )

    @property
    def fence(self) -> int | None:
        """The fence of the program's control; None without control."""
        control = self._control
        return control.fence if self.is_open and control and control.state == "yours" else None

    async def change(self, message: Any) -> Control:
        """Request a change of control, and return control after the change. Raises `NotDone`."""
        carried_out = _CARRIED_OUT[type(message)]
        control: Control = await self._ask(message, lambda one: isinstance(one, Control) and carried_out(one))
        return control

    async def request(self, make: Callable[[int, int], Any]) -> None:
        """Send the task that `make` builds from fence and sequence number, and wait until it is accepted.

        Raises `NotDone`: refused, or no answer in time.
        """
        fence = self.fence
        if fence is None:
            raise NotDone(_NOT_YOURS)
        message = make(fence, next(self._numbers))
        kind = kind_of(message)
        await self._ask(
            message,
            lambda one: isinstance(one, Accepted) and (one.of, one.seq) == (kind, message.seq),
            seq=message.seq,
        )

    async def _ask(self, message: Any, answers: Wanted, seq: int | None = None) -> Any:
        """Send a message, and return its answer. Raises `NotDone`: refused, or no answer in time."""
        kind = kind_of(message)

        def refuses(one: Any) -> bool:
            return isinstance(one, Refused) and one.of == kind and one.seq in (seq, None)

        mark = await self._send(message)
        answer = await self._until(lambda one: answers(one) or refuses(one), mark, ANSWER_S)
        if isinstance(answer, Refused):
            raise NotDone(answer.refusal)
        return answer

    async def send_checked(self, message: Any) -> Refusal | None:
        """Send a message whose only possible answer is a refusal.

        Return the refusal; None: none came at once.
        """
        mark = await self._send(message)
        kind = kind_of(message)
        try:
            found = await self._until(
                lambda one: isinstance(one, Refused) and one.of == kind, mark, REFUSED_AT_ONCE_S
            )
        except NotDone:
            return None
        refusal: Refusal = found.refusal
        return refusal

    async def offered(self) -> Offers:
        """Return the offers of the robot. Raises `NotDone`: they did not come in time."""
        if self.offers is None:
            await self._until(lambda one: isinstance(one, Offers), 0, ANSWER_S)
        return self.offers or Offers()

    async def drive(self, velocity: Velocity, seconds: float) -> float:
        """Drive with a velocity for these seconds, then send zero. A newer call replaces this one at once.

        Calls do not wait for each other, because a velocity that waited would be old. Return the seconds for
        which the velocity was sent. Raises `NotDone`: refused.
        """
        fence = self.fence
        if fence is None:
            raise NotDone(_NOT_YOURS)
        self._newest_drive = number = self._newest_drive + 1
        began_s = time.monotonic()
        zero = Velocity(0.0, 0.0, 0.0, velocity.share)
        refused: Refused | None = None
        while refused is None and self._goes_on(number, fence) and time.monotonic() - began_s < seconds:
            refused = await self._refused(await self._drive(fence, velocity))
            if refused is not None and _needs_only_neutral(refused.refusal):
                refused = None
                await self._drive(fence, zero)
                await asyncio.sleep(NEUTRAL_S)
        lasted_s = time.monotonic() - began_s
        if self._goes_on(number, fence):
            with suppress(NotDone):
                await self._drive(fence, zero)
        if refused is not None:
            raise NotDone(_without_stick(refused.refusal))
        if self.fence != fence:
            raise NotDone(_NOT_YOURS)
        return lasted_s

    def _goes_on(self, drive: int, fence: int) -> bool:
        return self._newest_drive == drive and self.fence == fence

    async def _drive(self, fence: int, velocity: Velocity) -> int:
        return await self._send(
            wire.Drive(
                fence=fence,
                seq=next(self._numbers),
                sent_ms=1000.0 * time.monotonic(),
                x=velocity.x,
                y=velocity.y,
                w=velocity.w,
                share=velocity.share,
            )
        )

    async def _refused(self, mark: int) -> Refused | None:
        """Wait for `REPEAT_S`, and return the refusal of the drive message, if there is one."""
        try:
            found = await self._until(
                lambda one: isinstance(one, Refused) and one.of == "drive", mark, REPEAT_S
            )
        except NotDone:
            return None
        return found if isinstance(found, Refused) else None

    async def close(self) -> None:
        """Close the connection: control ends as when a page is closed."""
        with suppress(OSError, ConnectionClosed):
            await self._socket.close()
        self._reading.cancel()
        self._pinging.cancel()

    async def _send(self, message: Any) -> int:
        """Send a message. Return its mark: its answer has a higher number. Raises `NotDone`."""
        raw = wire.encode(message)
        # A message that is not valid is refused here: a very large one would end the connection.
        wire.browser_message(raw)
        mark = self._count
        try:
            await self._socket.send(raw.decode())
        except ConnectionClosed as error:
            raise NotDone(self._why_gone()) from error
        return mark

    async def _until(self, wanted: Wanted, mark: int, within_s: float) -> Any:
        """Return the first wanted message after the mark. Raises `NotDone`: none came in time."""

        def found() -> Any:
            return next((one for number, one in self._received if number > mark and wanted(one)), None)

        async with self._news:
            try:
                await asyncio.wait_for(
                    self._news.wait_for(lambda: found() is not None or not self.is_open), within_s
                )
            except TimeoutError as error:
                raise NotDone(_SILENT) from error
        message = found()
        if message is None:
            raise NotDone(self._why_gone())
        return message

    def _why_gone(self) -> Refusal:
        code = self._socket.close_code
        text = say("{gone} ({why})", gone=GONE.sentence, why=self._socket.close_reason)
        return Refusal(GONE.code, text, GONE.rule) if code else GONE

    async def _ping(self) -> None:
        """Send pings while the program is present."""
        with suppress(NotDone):
            while True:
                await asyncio.sleep(PING_S)
                if self.fence is not None and time.monotonic() - self.used_s < PRESENT_S:
                    await self._send(wire.Ping(1000.0 * time.monotonic()))

    async def _read(self) -> None:
        try:
            async for raw in self._socket:
                await self._receive(raw)
        except (ConnectionClosed, OSError) as error:
            log.info("A program's connection ended: %s", error)
        finally:
            self.is_open = False
            async with self._news:
                self._news.notify_all()

    async def _receive(self, raw: str | bytes) -> None:
        try:
            message = wire.browser_report(raw)
        except msgspec.DecodeError:
            return  # a view of the robot, or another message that programs do not need
        if isinstance(message, Control):
            self._control, self._control_s = message, time.monotonic()
        elif isinstance(message, Offers):
            self.offers = message
        async with self._news:
            self._count += 1
            self._received.append((self._count, message))
            self._news.notify_all()


def _needs_only_neutral(refusal: Refusal) -> bool:
    """Return whether a zero clears this refusal. After a refused reverse, only a new call says that somebody looked."""
    return refusal.code == "neutral_needed" and refusal.figures.get("because") != "behind_unseen"


def _without_stick(refusal: Refusal) -> Refusal:
    """Return a refusal for a program: it has no stick, and the zero that was needed is sent."""
    why = str(refusal.figures.get("why", ""))
    if refusal.code != "neutral_needed" or not why:
        return refusal
    return structs.replace(refusal, text=standing_alone(why))


def _left(seconds: float | None, age_s: float) -> float | None:
    return None if seconds is None else max(0.0, round(seconds - age_s, 1))


def _aged(booked: Booked | None, age_s: float) -> Booked | None:
    return booked and structs.replace(booked, seconds=max(0.0, booked.seconds - age_s))
