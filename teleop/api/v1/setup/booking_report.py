"""The report of bookings, as on its page."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Annotated, Literal

from django.db.models import Q
from django.shortcuts import get_object_or_404
from django.utils import timezone
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from fleet.base.zones import zone_of
from fleet.bookings.hours.report import report
from fleet.bookings.rules import day_of
from robots.access.selectors import courses_managed_by, lab_date, robots_managed_by
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import entry_of, operation
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import SetupView

_FOR_SUPERVISORS = Refusal("permission_denied", "The report is for supervisors and staff.", "account")
_LONG_AGO = timedelta(days=30)
Slug = Annotated[str, Meta(max_length=100)]


class ReportAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """Whose hours are summed, and how. Days are those of the lab; both are included."""

    by: Literal["robot", "person", "course"] = "robot"
    course: Annotated[Slug, Meta(description="Only this one; its term, unless days are given.")] | None = None
    robot: Slug | None = None
    person: Annotated[str, Meta(max_length=150, description="A user name.")] | None = None
    from_: Annotated[date, Meta(description="If left out: 30 days before today.")] | None = None
    to: Annotated[date, Meta(description="If left out: today.")] | None = None


class ReportRow(Struct, frozen=True):
    """The sums of one robot, person or course: hours, and numbers of bookings."""

    name: str
    bookings: int
    booked_h: float
    used_h: float
    not_used: int
    cancelled: int


class BookingReport(Struct, frozen=True, rename={"from_": "from"}):
    """The sums of the bookings that begin on these days, by name."""

    from_: date
    to: date
    rows: list[ReportRow]


class BookingReportView(SetupView):
    tag = "bookings"

    @operation("bookings_report", "Sum booked and used hours", scope=Scope.READ, refuses=(404,))
    def get(self, query: ReportAsked) -> BookingReport:
        """Of the robots and courses that you manage."""
        robots = [robot for robot in robots_managed_by(self.person) if self.token_serves(robot.id)]
        courses = [course for course in courses_managed_by(self.person) if self.serves(course.robots.all())]
        if not (self.person.is_staff or robots or courses):
            raise Problem(_FOR_SUPERVISORS)
        today, only = lab_date(), Q()
        first, last = query.from_ or today - _LONG_AGO, query.to or today
        if query.course is not None:
            term = get_object_or_404(courses_managed_by(self.person), slug=query.course)
            robots, courses = [], [one for one in courses if one == term]
            first, last = query.from_ or term.starts_on, query.to or term.ends_on
        if query.robot is not None:
            only &= Q(robot=self.robot(query.robot))
        if query.person is not None:
            only &= Q(person__username=query.person)
        lab = zone_of("")
        starts, ends = day_of(min(first, last), lab).starts_at, day_of(max(first, last), lab).ends_at
        rows = report(robots, courses, starts=starts, ends=ends, by=query.by, now=timezone.now(), only=only)
        return BookingReport(first, last, [entry_of(ReportRow, row) for row in rows])
