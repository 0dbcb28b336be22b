"""Permissions of a person on other people's bookings.

Staff, and people with the supervisor role on the robot itself, manage all bookings of the robot and its
policy. The supervisors of a course manage only bookings of the course: its robots may serve other courses,
too.
"""

from __future__ import annotations

from datetime import datetime
from typing import Protocol
from uuid import UUID

from django.db.models import Q, QuerySet

from fleet.accounts.models import User
from fleet.bookings.models import Booking, State
from fleet.bookings.selectors import OPEN, Stage, courses_for, grace_of, policies_of, stage_of
from robots.access.models import Course, Enrolment
from robots.access.selectors import courses_managed_by, manages_robot, robots_managed_by, role_on
from robots.access.who_sees import Reader
from robots.registry.models import Robot


def may_manage_booking(person: User, booking: Booking) -> bool:
    """Return whether the person may change and approve this booking of another person."""
    return manages_robot(person, booking.robot) or _manages(person, booking.course)


def bookings_managed_by(person: User, bookings: QuerySet[Booking]) -> QuerySet[Booking]:
    """Return the bookings among these that `may_manage_booking` allows."""
    robots, courses = robots_managed_by(person), courses_managed_by(person)
    return bookings.filter(
        Q(robot__in=robots.values("pk").order_by()) | Q(course__in=courses.values("pk").order_by())
    )


class Booked(Protocol):
    """The columns of a booking that say whom it is about."""

    @property
    def robot_id(self) -> UUID: ...
    @property
    def person_id(self) -> UUID: ...
    @property
    def course_id(self) -> int | None: ...


def shows_person(reader: Reader, booking: Booked, stage: Stage) -> bool:
    """Return whether a booking in this stage shows its person and purpose; else only its times."""
    return stage in OPEN or reader.sees_past(booking.robot_id, [booking.person_id], booking.course_id)


def awaiting_approval(person: User, now: datetime) -> list[Booking]:
    """Return the bookings that the person may approve, earliest first. Their grace time is not over."""
    waits = bookings_managed_by(person, Booking.objects.filter(state=State.AWAITING, held_until__gt=now))
    found = list(waits.select_related("robot", "person").order_by("starts_at"))
    policies = policies_of({one.robot for one in found})
    return [one for one in found if stage_of(one, grace_of(policies[one.robot_id]), now) is Stage.AWAITING]


def may_book_for(person: User, owner: User, robot: Robot, at: datetime) -> bool:
    if person == owner or manages_robot(person, robot):
        return True
    return any(_manages(person, course) for course in courses_for(robot, owner, at))


def may_learn_of(person: User, other: User, robot: Robot, at: datetime) -> bool:
    """Return whether the person may learn that the account of `other` exists.

    Staff may learn of everybody, a supervisor of the robot of people with a role on the robot at that moment,
    a supervisor of a course of the people in it.
    """
    if person.is_staff or person == other:
        return True
    if manages_robot(person, robot) and role_on(other, robot, at) is not None:
        return True
    return Enrolment.objects.filter(course__in=courses_managed_by(person), person=other).exists()


def _manages(person: User, course: Course | None) -> bool:
    return course is not None and courses_managed_by(person).filter(pk=course.pk).exists()
