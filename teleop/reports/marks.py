"""The use of the robots in a course, for marks: one line for everybody who is enrolled, also without any drive.

Read from control sessions, bookings and the records of drives. A minute in control counts for the course in its
bookings (a lesson, or a booking by the course), and in free time on its robots between its two dates. Minutes in
bookings that are not the course's do not count.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from uuid import UUID

from django.db.models import Q
from django.utils import timezone
from django.utils.translation import get_language
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.reading.exports import safe_cell
from fleet.audit.services import record
from fleet.base import zones
from fleet.bookings.models import Booking, Shared, State
from fleet.bookings.selectors import NOT_YET
from robots.access.models import Course
from robots.access.selectors import robots_of
from robots.access.who_sees import Reader, reader_of
from teleop.models import ControlSession
from teleop.reports.robot_report import figure

MINUTE = timedelta(minutes=1)
_CHUNK = 500


class Mark(Struct):
    """The figures of one person."""

    username: str
    name: str
    number: str  # of the student; "": the course has none
    email: str
    sessions: int = 0  # control sessions with time that counts
    minutes: float = 0.0  # in control, all together
    metres: float = 0.0
    lessons: int = 0  # lessons in which the person drove
    lesson_minutes: float = 0.0
    free_minutes: float | None = 0.0  # None: you may not see them, because the robots are none of yours now
    bookings: int = 0  # by the course, begun or over
    not_used: int = 0  # of these


class _Stretch(Struct, frozen=True):
    """A part of a control session, within one booking, or in free time."""

    starts: datetime
    ends: datetime
    booking: Booking | None


def marks_exported(course: Course, reader: User, now: datetime) -> list[Mark]:
    """Return `marks_of`. Recorded."""
    marks = marks_of(course, reader, now)
    record("course.marks", actor=reader, parameters={"course": course.slug, "rows": len(marks)})
    return marks


def marks_of(course: Course, reader: User, now: datetime) -> list[Mark]:
    """Return the figures of everybody in a course, by name, as far as `reader` sees the past of others."""
    enrolments = course.enrolments.select_related("person").order_by("person__full_name", "person__username")
    marks = {
        one.person_id: Mark(one.person.username, one.person.display_name, one.number, one.person.email)
        for one in enrolments
    }
    _count_bookings(course, marks, now)
    _count_control(course, reader_of(reader), marks, now)
    return list(marks.values())


def _count_bookings(course: Course, marks: dict[UUID, Mark], now: datetime) -> None:
    begun = Booking.objects.filter(course=course, person__in=marks, starts_at__lte=now)
    for one in begun.exclude(state__in=[State.CANCELLED, *NOT_YET]):
        if _is_lesson(one):
            continue
        mark = marks[one.person_id]
        mark.bookings += 1
        mark.not_used += one.state == State.NO_SHOW or (one.used_at is None and one.ends_at <= now)


def _count_control(course: Course, reader: Reader, marks: dict[UUID, Mark], now: datetime) -> None:
    lab = timezone.get_default_timezone()
    starts, ends = zones.start_of(course.starts_on, lab), min(zones.end_of(course.ends_on, lab), now)
    own = set(robots_of(course).values_list("pk", flat=True))
    seen = {robot for robot in own if reader.sees_past(robot)}
    booked = Booking.objects.filter(course=course).values_list("robot_id", flat=True)
    robots = own | set(booked)
    calendar = _Calendar(robots, starts, ends)
    found = ControlSession.objects.filter(
        Q(ended_at=None) | Q(ended_at__gt=starts), user__in=marks, robot__in=robots, started_at__lt=ends
    )
    if not seen:
        for mark in marks.values():
            mark.free_minutes = None
    lessons: dict[UUID, set[UUID]] = defaultdict(set)
    counted: dict[UUID, tuple[Mark, list[_Stretch]]] = {}
    for session in found.order_by("started_at"):
        mark = marks[session.user_id]
        parts = calendar.parts(
            session.robot_id, max(session.started_at, starts), min(session.ended_at or now, ends)
        )
        kept = [
            part
            for part in parts
            if (part.booking.course_id == course.pk if part.booking else session.robot_id in seen)
        ]
        for part in kept:
            minutes = (part.ends - part.starts) / MINUTE
            mark.minutes += minutes
            if part.booking is None:
                mark.free_minutes = (mark.free_minutes or 0.0) + minutes
            elif _is_lesson(part.booking):
                mark.lesson_minutes += minutes
                lessons[session.user_id].add(part.booking.pk)
        if kept:
            mark.sessions += 1
            counted[session.pk] = mark, kept
    for person, joined in lessons.items():
        marks[person].lessons = len(joined)
    for session_id, at, metres in _drives(counted):
        mark, kept = counted[session_id]
        if any(part.starts <= at <= part.ends for part in kept):
            mark.metres += metres or 0.0


def _drives(sessions: Iterable[UUID]) -> Iterator[tuple[UUID, datetime, float | None]]:
    """Yield session, end and metres of each drive of these sessions."""
    keys = list(sessions)
    for first in range(0, len(keys), _CHUNK):
        ended = Record.objects.filter(kind="drive.end", session_id__in=keys[first : first + _CHUNK])
        for one in ended.annotate(metres=figure("distance_m")).values("session_id", "at", "metres"):
            if one["session_id"] is not None:
                yield one["session_id"], one["at"], one["metres"]


class _Calendar:
    """The bookings of some robots in a period, in which no two of a robot overlap."""

    def __init__(self, robots: Iterable[UUID], starts: datetime, ends: datetime) -> None:
        self._of: dict[UUID, list[Booking]] = defaultdict(list)
        held = Booking.objects.filter(robot__in=robots, starts_at__lt=ends, held_until__gt=starts)
        for one in held.exclude(state__in=[State.CANCELLED, *NOT_YET]).order_by("starts_at"):
            self._of[one.robot_id].append(one)

    def parts(self, robot: UUID, starts: datetime, ends: datetime) -> list[_Stretch]:
        """Divide a time on a robot by the bookings that hold it."""
        parts, at, bookings = [], starts, self._of[robot]
        first = max(bisect_left(bookings, starts, key=lambda one: one.starts_at) - 1, 0)
        for booking in bookings[first:]:
            if booking.starts_at >= ends:
                break
            begins, until = max(booking.starts_at, at), min(booking.held_until, ends)
            if until > begins:
                parts += [_Stretch(at, begins, None), _Stretch(begins, until, booking)]
                at = until
        return [part for part in (*parts, _Stretch(at, ends, None)) if part.ends > part.starts]


def _is_lesson(booking: Booking) -> bool:
    return booking.shared == Shared.COURSE


# --- as a file ------------------------------------------------------------------------------------


def separator() -> str:
    """Return the mark between columns that spreadsheets expect in the reader's language."""
    return "," if (get_language() or "en").startswith("en") else ";"


def lines(marks: Sequence[Mark]) -> Iterator[list[str]]:
    """Yield the lines of a CSV file, with titles in the reader's language; minutes and metres without fractions."""
    yield [
        *(
            _("name"),
            _("user name"),
            _("student number"),
            _("e-mail"),
            _("sessions"),
            _("minutes"),
            _("metres"),
        ),
        *(_("lessons"), _("minutes in lessons"), _("minutes in free time"), _("bookings"), _("not used")),
    ]
    for one in marks:
        words = [safe_cell(text) for text in (one.name, one.username, one.number, one.email)]
        figures = (one.sessions, one.minutes, one.metres, one.lessons, one.lesson_minutes)
        yield [
            *words,
            *map(_whole, (*figures, one.free_minutes, one.bookings, one.not_used)),
        ]


def _whole(value: float | None) -> str:
    return "" if value is None else str(round(value))
