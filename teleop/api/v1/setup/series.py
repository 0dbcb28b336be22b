"""Weekly series of bookings: a preview, the bookings, and changes of all of them."""

from __future__ import annotations

from datetime import date, time
from typing import Annotated, Any
from uuid import UUID

from django.utils import timezone
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from fleet.base.zones import names, zone_of
from fleet.bookings.changes.series import MOST_WEEKS, Week, preview, series_make, weekly
from fleet.bookings.changes.whole_series import Change, Date, dates_of, series_cancel, series_move, series_of
from fleet.bookings.models import WEEKDAYS, Booking
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import Stage
from robots.access.models import Course
from robots.access.selectors import (
    courses_managed_by,
    lab_date,
    manages_robot,
    robots_bookable_by,
    robots_of,
    robots_supervised_by,
)
from robots.registry.models import Robot
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import operation, reads
from teleop.api.v1.framework.parameters import Moment, Time, utc
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import SetupView
from teleop.api.v1.setup.policies import Weekday

Clock = Annotated[str, Meta(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9]$")]

_NOT_SUPERVISED = Refusal("permission_denied", "Weekly series are for supervisors and staff.", "account")
_NO_ZONE = Refusal("invalid", "There is no time zone with this name, such as Europe/Madrid.", "wire")
_BACKWARDS = Refusal("invalid", "The slot ends before it begins: exchange the two times.", "wire")


class SeriesRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """The first slot, and how often it is repeated. `preview`: book nothing.

    Begin and end keep their times of day in `zone`.
    """

    robot: Annotated[str, Meta(min_length=1, max_length=100)]
    starts_at: Moment
    ends_at: Moment
    weeks: Annotated[int, Meta(ge=1, le=MOST_WEEKS)]
    purpose: Annotated[str, Meta(min_length=1, max_length=120)]
    without: Annotated[list[date], Meta(max_length=MOST_WEEKS)] = []  # days that are left out
    zone: Annotated[str, Meta(max_length=64)] | None = None  # null: the lab's time zone
    course: Annotated[str, Meta(max_length=100)] | None = None  # slug: the slots are lessons of this course
    turn_min: Annotated[int, Meta(ge=1, le=240)] | None = None  # its people take turns of so many minutes
    record: bool = False  # what the robot senses in each slot is recorded
    override: Annotated[str, Meta(max_length=200)] = ""  # why against the policy, for managers of the robot
    preview: bool = False


class SeriesWeek(Struct, frozen=True):
    """One date. `booking` null: a preview, or `refusals` refuse it. Times null: the clock skips them that day."""

    day: date
    starts_at: Time | None
    ends_at: Time | None
    booking: UUID | None
    refusals: list[Refusal]


class SeriesAnswer(Struct, frozen=True):
    """The weeks in their order. `series` is in each booking; null: none was made."""

    series: UUID | None
    weeks: list[SeriesWeek]


class SeriesChange(Struct, frozen=True, forbid_unknown_fields=True):
    """New facts for the dates to come; fields that are left out stay. `preview`: move none.

    Weekday and time of day are those of the lab's zone. Each date stays in its week.
    """

    weekday: Weekday | None = None
    begins: Clock | None = None
    minutes: Annotated[int, Meta(ge=1, le=10080)] | None = None  # the length of each
    robot: Annotated[str, Meta(min_length=1, max_length=100)] | None = None
    since: date | None = None  # the first day; null: today
    override: Annotated[str, Meta(max_length=200)] = ""  # why against the policy, for managers of the robot
    preview: bool = False


class SeriesEnd(Struct, frozen=True, forbid_unknown_fields=True):
    """Which dates are cancelled, and why."""

    since: date | None = None
    reason: Annotated[str, Meta(max_length=200, description="Their person reads it.")] = ""
    preview: Annotated[bool, Meta(description="Cancel none.")] = False


class SeriesView(SetupView):
    tag = "bookings"
    seen_by = staticmethod(robots_bookable_by)

    @operation(
        "bookings_series",
        "Book a weekly series",
        scope=Scope.BOOK,
        refuses=(404,),
        keyed=True,
        examples={
            "Twelve lessons": {
                "robot": "tiago-1",
                "starts_at": "2026-03-02T14:00:00Z",
                "ends_at": "2026-03-02T15:00:00Z",
                "weeks": 12,
                "purpose": "Lab course",
                "preview": True,
            }
        },
    )
    def post(self, body: SeriesRequest) -> SeriesAnswer:
        """For supervisors, also of a course, and staff. Weeks that a rule refuses are left out and say why."""
        robot, course = self._supervised(body.robot), self._course(body.course)
        if body.zone is not None and body.zone not in names():
            raise Problem(_NO_ZONE)
        first, now = Slot(utc(body.starts_at), utc(body.ends_at)), timezone.now()
        if first.ends_at <= first.starts_at:
            raise Problem(_BACKWARDS)
        zone = zone_of(body.zone or "")
        slots = weekly(first, body.weeks, body.without, zone)
        if body.preview:
            valid = bool(body.override) and manages_robot(self.person, robot)
            weeks = preview(
                robot=robot,
                person=self.person,
                slots=slots,
                now=now,
                override=valid,
                lesson=course is not None,
            )
            return SeriesAnswer(None, [_week(week) for week in weeks])
        made, left = series_make(
            robot=robot,
            person=self.person,
            actor=self.person,
            slots=slots,
            purpose=body.purpose,
            override=body.override,
            course=course,
            turn_min=body.turn_min,
            record_it=body.record,
            now=now,
        )
        entries = [_week(week) for week in left]
        for booking in made:
            day = booking.starts_at.astimezone(zone).date()
            entries.append(SeriesWeek(day, booking.starts_at, booking.ends_at, booking.pk, []))
        return SeriesAnswer(made[0].series if made else None, sorted(entries, key=lambda week: week.day))

    def concerned(self, body: SeriesRequest, **_asked: Any) -> list[Robot]:
        course = self._course(body.course)
        return [self.robot(body.robot), *(robots_of(course) if course else ())]

    def _supervised(self, slug: str) -> Robot:
        robot = self.robot(slug)
        if not robots_supervised_by(self.person).filter(pk=robot.pk).exists():
            raise Problem(_NOT_SUPERVISED)
        return robot

    def _course(self, slug: str | None) -> Course | None:
        if slug is None:
            return None
        found: Course | None = courses_managed_by(self.person).filter(slug=slug, archived=False).first()
        if found is None or not self.serves(robots_of(found)):
            raise Problem(NOT_FOUND)
        return found


class WholeSeriesView(SetupView):
    tag = "bookings"
    seen_by = staticmethod(robots_bookable_by)

    def concerned(self, series: UUID, **asked: Any) -> list[Robot]:
        other = getattr(asked.get("body"), "robot", None)
        robots = {one.robot for one in self.bookings(series)} | ({self.robot(other)} if other else set())
        return list(robots)

    def bookings(self, series: UUID) -> list[Booking]:
        """Return the bookings of the series that the person may change. Raises `Problem`: there is none."""
        if not (found := list(series_of(self.person, series))):
            raise Problem(NOT_FOUND)
        return found

    @reads("bookings_series_read", "Read a weekly series")
    def get(self, series: UUID) -> SeriesAnswer:
        """Its dates that are not cancelled, if you may change them. `refusals`: what is against a date to come now,
        such as closed hours."""
        now = timezone.now()
        dates = [one for one in dates_of(self.bookings(series), now) if one.stage is not Stage.CANCELLED]
        return SeriesAnswer(series, [_date(one) for one in dates])

    @operation("bookings_series_move", "Move a weekly series", scope=Scope.BOOK, refuses=(404,))
    def patch(self, series: UUID, body: SeriesChange) -> SeriesAnswer:
        """Dates to come from a day on, with their new times. A date with `refusals` stays as it is."""
        change = Change(
            WEEKDAYS.index(body.weekday) if body.weekday else None,
            time.fromisoformat(body.begins) if body.begins else None,
            body.minutes,
            self.robot(body.robot) if body.robot else None,
        )
        done = series_move(
            self.bookings(series),
            change,
            since=body.since or lab_date(),
            actor=self.person,
            now=timezone.now(),
            override=body.override,
            preview=body.preview,
        )
        return SeriesAnswer(series, [_date(one) for one in done])

    @operation("bookings_series_cancel", "Cancel a weekly series", scope=Scope.BOOK, refuses=(404,))
    def delete(self, series: UUID, query: SeriesEnd) -> SeriesAnswer:
        """Dates to come from a day on (today, if left out). A date with `refusals` stays as it is."""
        done = series_cancel(
            self.bookings(series),
            since=query.since or lab_date(),
            actor=self.person,
            now=timezone.now(),
            reason=query.reason,
            preview=query.preview,
        )
        return SeriesAnswer(series, [_date(one) for one in done])


def _date(one: Date) -> SeriesWeek:
    slot = one.slot or Slot(one.booking.starts_at, one.booking.ends_at)
    day = slot.starts_at.astimezone(zone_of("")).date()
    return SeriesWeek(day, slot.starts_at, slot.ends_at, one.booking.pk, one.refusals)


def _week(week: Week) -> SeriesWeek:
    slot = week.slot
    starts, ends = (slot.starts_at, slot.ends_at) if slot else (None, None)
    return SeriesWeek(week.day, starts, ends, None, week.refusals)
