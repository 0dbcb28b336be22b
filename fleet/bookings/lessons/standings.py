"""The line of a shared booking as people see it: who drives, who is called, who waits about how long."""

from __future__ import annotations

from datetime import datetime, timedelta

from msgspec import Struct

from fleet.accounts.models import User
from fleet.bookings.lessons.turns import ALIVE, OPEN
from fleet.bookings.models import Booking, Turn


class Standing(Struct, frozen=True):
    """A turn that is not over."""

    id: int
    person: User
    state: str  # a `Turn.State`
    place: int | None  # in line, from 1; None: called or driving
    begins_in_min: int | None  # about; None: called or driving
    ends_at: datetime | None  # of the person who drives
    called_at: datetime | None
    in_time: bool = True  # about; it begins before the slot ends


def standings(booking: Booking, now: datetime) -> list[Standing]:
    """Return the line: who is called or drives first, then who waits, the next one first."""
    alive = list(booking.turns.filter(state__in=ALIVE).select_related("person"))
    wait = max(booking.starts_at - now, timedelta(0))
    found = []
    place = 0
    for turn in sorted(alive, key=lambda one: one.state not in OPEN):
        waits = turn.state == Turn.State.WAITING
        place += waits
        minutes = round(wait / timedelta(minutes=1)) if waits else None
        found.append(
            Standing(
                turn.pk,
                turn.person,
                turn.state,
                place or None,
                minutes,
                turn.ends_at,
                turn.called_at,
                now + wait < booking.held_until,
            )
        )
        wait += _lasts(turn, booking, now)
    return found


def _lasts(turn: Turn, booking: Booking, now: datetime) -> timedelta:
    if turn.ends_at is not None:
        return max(turn.ends_at - now, timedelta(0))
    whole = timedelta(minutes=booking.turn_min or 0)
    return whole if turn.left_s is None else timedelta(seconds=turn.left_s)
