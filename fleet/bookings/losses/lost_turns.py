"""The people who lose a turn by a change: a line skips people who may not drive, so the preview names them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import partial

from fleet.base.formats.sentences import words_of
from fleet.bookings.lessons.members import sharers_of
from fleet.bookings.lessons.turns import ALIVE, NOT_IN_IT
from fleet.bookings.losses.collecting import How, collected, kept_of, lost
from fleet.bookings.losses.rights import Wanted, wishes_of
from fleet.bookings.messages.notifications import AHEAD
from fleet.bookings.models import State, Turn
from fleet.bookings.rules import Slot, lost_right
from robots.shared.wire import Refusal


@contextmanager
def turns_watched(now: datetime) -> Iterator[None]:
    """Collect the turns of people whom the line skips after the change, and only then.

    Of a lesson that ends, each person hears as one who shares it.
    """
    before = set(_skipped(now))
    yield
    if (found := collected()) is None:
        return
    ended = {one.booking.pk for one in found.losses}
    for key, (turn, why) in _skipped(now).items():
        if key not in before and turn.booking_id not in ended:
            kept = kept_of(turn.booking)
            lost(turn.booking, How.TURN, now, before=kept, why=partial(words_of, why), turn=turn)


def _skipped(now: datetime) -> dict[int, tuple[Turn, Refusal]]:
    """Return the turns, by key, of people who may not drive, in lines that run now or begin within an hour."""
    soon = Turn.objects.filter(
        state__in=ALIVE,
        booking__state=State.BOOKED,
        booking__starts_at__lte=now + AHEAD,
        booking__held_until__gt=now,
    )
    turns = list(soon.select_related("person", "booking__person", "booking__robot", "booking__course"))
    sharers = sharers_of({one.booking_id: one.booking for one in turns}.values())
    times = [max(now, one.booking.starts_at) for one in turns]
    wanted = [
        Wanted(one.person, one.booking.robot, Slot(at, at)) for one, at in zip(turns, times, strict=True)
    ]
    found = {}
    for turn, wish in zip(turns, wishes_of(wanted, now), strict=True):
        shares = turn.person in (turn.booking.person, *sharers[turn.booking_id])
        if (why := lost_right(wish) if shares else NOT_IN_IT) is not None:
            found[turn.pk] = turn, why
    return found
