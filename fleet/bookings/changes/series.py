"""A weekly series of bookings: preview it, then book the slots that no rule refuses."""

from __future__ import annotations

from collections.abc import Collection
from datetime import date, datetime, timedelta
from uuid import uuid4
from zoneinfo import ZoneInfo

from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.base.zones import zone_of
from fleet.bookings.models import Booking
from fleet.bookings.rules import BINDING, RULES, Slot, refusals, to_utc
from fleet.bookings.selectors import wish_of
from fleet.bookings.services import BookingRefused, booking_make
from robots.access.models import Course
from robots.registry.models import Robot
from robots.shared.wire import Refusal

MOST_WEEKS = 30


class Week(Struct, frozen=True):
    """One slot of a series, and the reasons why it cannot be booked.

    `slot` None: its time does not exist on that day, because daylight saving skips it.
    """

    day: date
    slot: Slot | None
    refusals: list[Refusal]


def weekly(
    first: Slot, weeks: int, without: Collection[date], zone: ZoneInfo | None = None
) -> list[tuple[date, Slot | Refusal]]:
    """Return one slot for each week, without the days in `without`.

    Begin and end keep the wall-clock times of the first slot, in the lab's zone unless `zone` names another.
    For a begin or end that daylight saving skips, return a refusal in place of the slot.
    """
    zone = zone or zone_of("")
    starts, ends = (
        moment.astimezone(zone).replace(tzinfo=None) for moment in (first.starts_at, first.ends_at)
    )
    found: list[tuple[date, Slot | Refusal]] = []
    for number in range(min(weeks, MOST_WEEKS)):
        later = timedelta(weeks=number)
        day = (starts + later).date()
        if day not in without:
            found.append((day, on_the_wall(starts + later, ends + later, zone) if number else first))
    return found


def on_the_wall(starts: datetime, ends: datetime, zone: ZoneInfo) -> Slot | Refusal:
    """Return the slot between two wall-clock times; a refusal if the clock skips one of them."""
    moments = [to_utc(starts, zone), to_utc(ends, zone, is_end=True)]
    skipped = next((one for one in moments if isinstance(one, Refusal)), None)
    return skipped or Slot(*(one for one in moments if isinstance(one, datetime)))


def preview(
    *,
    robot: Robot,
    person: User,
    slots: list[tuple[date, Slot | Refusal]],
    override: bool,
    lesson: bool,
    now: datetime,
) -> list[Week]:
    """Return each slot with all its refusals, and book nothing.

    `lesson`: the slots are lessons of a course.
    """
    weeks = []
    before: tuple[Slot, ...] = ()  # slots of earlier weeks count as if they were booked
    for day, slot in slots:
        if isinstance(slot, Refusal):
            weeks.append(Week(day, None, [slot]))
            continue
        wish = wish_of(robot=robot, person=person, slot=slot, now=now, lesson=lesson)
        wish = structs.replace(wish, own=wish.own + before, own_here=wish.own_here + before)
        found = refusals(wish, BINDING if override else RULES)
        weeks.append(Week(day, slot, found))
        before += () if found else (slot,)
    return weeks


def series_make(
    *,
    robot: Robot,
    person: User,
    actor: User,
    slots: list[tuple[date, Slot | Refusal]],
    purpose: str,
    override: str,
    now: datetime,
    course: Course | None = None,
    turn_min: int | None = None,
    record_it: bool = False,
) -> tuple[list[Booking], list[Week]]:
    """Book every slot that no rule refuses. Return the bookings, and the weeks that were left out.

    `course`: the slots are lessons of this course, with turns of `turn_min` minutes. `record_it`: each
    slot is recorded.
    """
    series = uuid4()
    made: list[Booking] = []
    left: list[Week] = []
    for day, slot in slots:
        if isinstance(slot, Refusal):
            left.append(Week(day, None, [slot]))
            continue
        try:
            booking = booking_make(
                robot=robot,
                person=person,
                actor=actor,
                slot=slot,
                purpose=purpose,
                override=override,
                series=series,
                lesson_of=course,
                turn_min=turn_min if course else None,
                record_it=record_it,
                now=now,
            )
            made.append(booking)
        except BookingRefused as error:
            left.append(Week(day, slot, error.refusals))
    return made, left
