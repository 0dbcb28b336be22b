"""The tasks that a lesson leaves to its members: its speed, motions, phrases and places, or only watch."""

from __future__ import annotations

from datetime import datetime
from uuid import UUID

from msgspec import convert, to_builtins

from fleet.accounts.models import User
from fleet.bookings.lessons.turns import NOT_TEACHER, OVER, leads
from fleet.bookings.models import Booking, Shared, State
from fleet.bookings.services import BookingRefused, record_booking, robot_locked
from robots.shared.wire import LessonTasks, Refusal

_NO_LESSON = Refusal(
    "no_lesson", "Only a booking for a course has tasks of its own: book it for the course.", "booking"
)


def tasks_of(booking: Booking) -> LessonTasks:
    """Return what the members of a lesson may do in it."""
    return convert(booking.tasks or {}, LessonTasks)


def lesson_tasks_set(
    *, booking_id: UUID, tasks: LessonTasks, actor: User, now: datetime, whole_series: bool = False
) -> int:
    """Choose what the members of a lesson may do in it. Return in how many lessons. Raises `BookingRefused`.

    It counts at once, also for who drives now. `whole_series`: also in all later dates of its weekly series.
    """
    robot_id = Booking.objects.values_list("robot_id", flat=True).get(pk=booking_id)
    with robot_locked(robot_id, now) as robot:
        booking = Booking.objects.select_related("person", "course").get(pk=booking_id)
        booking.robot = robot
        if not leads(actor, booking):
            raise BookingRefused([NOT_TEACHER])
        if booking.shared != Shared.COURSE:
            raise BookingRefused([_NO_LESSON])
        if booking.state not in (State.BOOKED, State.AWAITING) or booking.held_until <= now:
            raise BookingRefused([OVER])
        chosen = [booking, *(_later_dates(booking) if whole_series and booking.series else ())]
        stored = None if tasks == LessonTasks() else to_builtins(tasks)
        for one in chosen:
            Booking.objects.filter(pk=one.pk).update(tasks=stored)
            facts = {"share": tasks.max_share, "watch": tasks.watch}
            record_booking("booking.tasks", one, actor, parameters=facts)
    return len(chosen)


def _later_dates(booking: Booking) -> list[Booking]:
    found = Booking.objects.filter(series=booking.series, shared=Shared.COURSE, course=booking.course)
    found = found.filter(state__in=(State.BOOKED, State.AWAITING), starts_at__gt=booking.starts_at)
    return list(found.select_related("robot", "person"))
