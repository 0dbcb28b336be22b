"""Report the hours booked and used, and the slots not used, by robot, person or course."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from django.db.models import F, Q, QuerySet
from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.audit.reading.exports import safe_cell
from fleet.bookings.hours.driven import driven
from fleet.bookings.models import Booking, Shared, State
from fleet.bookings.selectors import NOT_YET, Stage, grace_of, policies_of, stage_of
from robots.access.models import Course
from robots.registry.models import Robot

_ALL = Q()
HOUR = timedelta(hours=1)
BY = {"robot": "robot__name", "person": "person__full_name", "course": "course__name"}


class Row(Struct):
    """The sums of one robot, person or course: hours, and numbers of bookings."""

    name: str
    bookings: int = 0
    booked_h: float = 0.0
    used_h: float = 0.0
    not_used: int = 0
    cancelled: int = 0


def report(
    robots: Collection[Robot] | QuerySet[Robot],
    courses: Collection[Course] | QuerySet[Course],
    *,
    starts: datetime,
    ends: datetime,
    by: str,
    now: datetime,
    only: Q = _ALL,
    whose: str = "",
) -> list[Row]:
    """Return the sums of the bookings that begin between two moments, by robot, person or course.

    Bookings of these robots count, and bookings of these courses on any robot. `only` limits both further, `whose` to
    people with this in their names. A lesson is its course's, not its teacher's: by person, the time that each drove in
    it is theirs.

    If the person took control in a slot, the slot counts as used from its start to its end, or to the time
    when it was given up. A slot without control counts as not used as soon as it is free for others.
    """
    these = Q(robot__in=robots) | Q(course__in=courses)
    found = Booking.objects.filter(these, starts_at__gte=starts, starts_at__lt=ends)
    found = found.filter(only).exclude(Q(state__in=NOT_YET) & Q(held_until=F("starts_at")))
    times = ("starts_at", "ends_at", "held_until", "state", "used_at")
    columns = dict.fromkeys((f"{by}_id", "robot_id", "person__username", *times))
    lessons = found.filter(shared=Shared.COURSE) if by == "person" else found.none()
    if by == "person":
        found = found.exclude(shared=Shared.COURSE)
    if whose:
        found = found.filter(Q(person__full_name__icontains=whose) | Q(person__username__icontains=whose))
    rows = found.annotate(name=F(BY[by])).values_list("name", *columns, named=True)
    sums = _sums(list(rows), by, now)
    _add_driven(sums, lessons, whose, now)
    return sorted(sums.values(), key=lambda row: row.name.lower())


def _add_driven(sums: dict[object, Row], lessons: QuerySet[Booking], whose: str, now: datetime) -> None:
    """Add the time that people drove in lessons to their rows."""
    minutes: dict[UUID, float] = defaultdict(float)
    for who, slot in driven(lessons.exclude(state=State.CANCELLED), now):
        minutes[who] += slot.minutes
    people = User.objects.filter(pk__in=minutes)
    if whose:
        people = people.filter(Q(full_name__icontains=whose) | Q(username__icontains=whose))
    for person in people:
        sums.setdefault(person.pk, Row(person.display_name)).used_h += minutes[person.pk] / 60.0


def _sums(rows: Collection[Any], by: str, now: datetime) -> dict[object, Row]:
    sums: dict[object, Row] = {}  # by key: two people may have the same name
    run = {row.robot_id for row in rows if row.used_at is None and row.starts_at <= now < row.ends_at}
    graces = {key: grace_of(one) for key, one in policies_of(Robot.objects.filter(pk__in=run)).items()}
    for row in rows:
        shown = row.name or (row.person__username if by == "person" else "-")
        total = sums.setdefault(getattr(row, f"{by}_id"), Row(shown))
        if row.state == State.CANCELLED:
            total.cancelled += 1
            continue
        total.bookings += 1
        total.booked_h += (row.ends_at - row.starts_at) / HOUR
        if row.used_at is not None:
            total.used_h += (min(row.held_until, max(now, row.starts_at)) - row.starts_at) / HOUR
        elif (row.ends_at <= now and row.state not in NOT_YET) or (
            stage_of(row, graces.get(row.robot_id, row.ends_at - row.starts_at), now) is Stage.NO_SHOW
        ):
            total.not_used += 1
    return sums


def lines(rows: list[Row]) -> list[list[str]]:
    """Return the report as the lines of a CSV file, with a heading."""
    heading = ["name", "bookings", "booked_h", "used_h", "not_used", "cancelled"]
    return [heading, *([_cell(value) for value in structs.astuple(row)] for row in rows)]


def _cell(value: object) -> str:
    """Return a value for a spreadsheet. "-" alone stands for no name."""
    if isinstance(value, float):
        return f"{value:.2f}"
    return safe_cell(value) if isinstance(value, str) and value != "-" else str(value)
