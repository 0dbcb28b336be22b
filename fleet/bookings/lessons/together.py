"""Lessons of one course on several robots at the same time, and the students spread over their lines."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import ExitStack
from datetime import datetime
from uuid import UUID

from django.db.models import Max

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.bookings.lessons.robots import why_nobody_is_called
from fleet.bookings.lessons.turns import OPEN, had_turn, locked_line, may_not_drive
from fleet.bookings.models import Booking, Shared, State, Turn
from robots.registry.services import named


def at_once(booking: Booking) -> list[Booking]:
    """Return the lessons of the same course on other robots at the same time, and this one, by robot."""
    if booking.shared != Shared.COURSE or booking.course_id is None:
        return [booking]
    found = Booking.objects.filter(
        course=booking.course_id,
        shared=Shared.COURSE,
        state__in=(State.BOOKED, State.AWAITING),
        starts_at__lt=booking.held_until,
        held_until__gt=booking.starts_at,
    )
    return list(found.select_related("robot", "person", "course").order_by("robot__name", "starts_at"))


def line_spread(*, booking_id: UUID, actor: User, now: datetime) -> int:
    """Share the students evenly over the lines of all robots of a lesson. Return how many now stand in a line.

    Who drives or is called stays. Who waits keeps the order; who had no turn yet comes behind, by name. Nobody gets a
    robot that they may not drive, or that nobody can drive now. Raises `BookingRefused`.
    """
    first = Booking.objects.select_related("course").get(pk=booking_id)
    with ExitStack() as locks:
        lessons = [
            locks.enter_context(locked_line(one.pk, now, actor))
            for one in sorted(
                at_once(first), key=lambda one: one.robot_id
            )  # one order: no two wait for each other
            if one.turn_min is not None
        ]
        waiting = list(
            Turn.objects.filter(booking__in=lessons, state=Turn.State.WAITING)
            .select_related("person")
            .order_by("number", "id")
        )
        lines = {one.pk: one.turns.filter(state__in=OPEN).count() for one in lessons}
        numbers = {one.pk: one.turns.aggregate(last=Max("number"))["last"] or 0 for one in lessons}
        drivable = [one for one in lessons if not why_nobody_is_called(one, now)] or lessons
        turns = [*waiting, *(Turn(person=one) for one in _without_turn(first, lessons))]
        there = set(Turn.objects.filter(booking__in=lessons, state__in=OPEN).values_list("person", flat=True))
        for turn in turns:
            if turn.person_id in there:  # one line for each person
                turn.delete()
                continue
            there.add(turn.person_id)
            able = [
                one for one in drivable if may_not_drive(one, turn.person, max(now, one.starts_at)) is None
            ]
            if not able:
                continue
            to = min(able, key=lambda one: (lines[one.pk], one.pk != turn.booking_id, one.robot.name))
            lines[to.pk] += 1
            numbers[to.pk] += 1
            turn.booking, turn.number = to, numbers[to.pk]
            turn.save()
        for one in lessons:
            parameters = {"booking": str(one.pk), "waiting": lines[one.pk]}
            record("turn.spread", actor=actor, **named(one.robot), parameters=parameters)
    return sum(lines.values())


def _without_turn(first: Booking, lessons: Collection[Booking]) -> list[User]:
    """Return who is in the course and had no turn yet in any of its lessons, by name."""
    there = had_turn(lessons).values("person")
    people = User.objects.filter(enrolments__course=first.course_id, is_active=True).exclude(pk__in=there)
    return sorted(people.distinct(), key=lambda one: one.display_name.lower())
