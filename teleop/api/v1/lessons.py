"""Shared bookings with turns: the line, and what its people and its teacher do with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal
from uuid import UUID

from django.utils import timezone
from msgspec import Meta, Struct, convert

from fleet.accounts.tokens.models import Scope
from fleet.bookings.lessons import turns
from fleet.bookings.lessons.members import shares
from fleet.bookings.lessons.standings import standings
from fleet.bookings.lessons.tasks import lesson_tasks_set
from fleet.bookings.lessons.together import at_once, line_spread
from fleet.bookings.services import BookingRefused
from robots.shared.wire import LessonTasks
from teleop.api.v1.bookings import BookingsBase, Username
from teleop.api.v1.framework.operation import operation, reads
from teleop.api.v1.framework.parameters import Time

Minutes = Annotated[int, Meta(ge=1, le=240)]


class TurnEntry(Struct, frozen=True):
    """A turn that is not over."""

    id: int
    person: str  # name
    username: str | None  # of yourself, and of everybody if you lead the lesson
    yours: bool
    state: Literal["waiting", "called", "driving"]
    place: int | None  # in line, from 1; null: called or driving
    begins_in_min: int | None  # about
    called_at: Time | None
    ends_at: Time | None


class TasksEntry(LessonTasks, frozen=True, forbid_unknown_fields=True):
    """The tasks that a lesson leaves to its members; it does not bind its leaders. An empty list: everything.

    `without` names what members may not use at all. `max_share` does not bind drives to a place, which the robot's own
    navigation drives.
    """


class TasksRequest(TasksEntry, frozen=True, forbid_unknown_fields=True):
    """The tasks that a lesson leaves to its members in their turn. Fields that are left out limit nothing.

    `whole_series`: also in all later dates of its weekly series.
    """

    whole_series: bool = False


class LessonEntry(Struct, frozen=True):
    """A shared booking with turns. `line`: who is called or drives first, then who waits."""

    booking: UUID
    robot: str
    course: str | None  # slug; null: of a team
    name: str  # of the course, or of the person who booked
    starts_at: Time
    ends_at: Time
    turn_min: int | None  # null: no turns, each takes the robot when it is free
    held: bool  # nobody is called now
    leads: bool  # you may call, skip, extend, fill and hold
    line: list[TurnEntry]
    tasks: TasksEntry
    at_once: list[UUID]  # the lessons of the course on all robots at this time, this one too


class CallNextRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """The person who is next."""

    username: Username


class ExtendRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """By how much the turn is longer."""

    minutes: Minutes


_line = partial(operation, scope=Scope.BOOK, answer=LessonEntry, refuses=(404, 409), keyed=True)


class LessonBase(BookingsBase):
    def lesson(self, booking_id: UUID) -> LessonEntry:
        """Return a shared booking as this person may see it. Raises `BookingRefused` or `Http404`."""
        booking, person = self.one(booking_id), self.person
        leads = turns.leads(person, booking)
        if not leads and not shares(booking, person):
            raise BookingRefused([turns.NOT_IN_IT])
        course = booking.course if booking.lesson_of else None
        line = [
            TurnEntry(
                one.id,
                one.person.display_name,
                one.person.username if leads or one.person == person else None,
                one.person == person,
                one.state,  # type: ignore[arg-type]
                one.place,
                one.begins_in_min,
                one.called_at,
                one.ends_at,
            )
            for one in standings(booking, timezone.now())
        ]
        return LessonEntry(
            booking=booking.pk,
            robot=booking.robot.slug,
            course=course.slug if course else None,
            name=booking.lesson_of or booking.person.display_name,
            starts_at=booking.starts_at,
            ends_at=booking.ends_at,
            turn_min=booking.turn_min,
            held=bool(booking.line_held),
            leads=leads,
            line=line,
            tasks=convert(booking.tasks or {}, TasksEntry),
            at_once=[one.pk for one in at_once(booking)],
        )

    def step(self, booking_id: UUID, step: Callable[..., Any], **facts: Any) -> LessonEntry:
        """Change the line, and return it."""
        self.one(booking_id)
        step(booking_id=booking_id, now=timezone.now(), **facts)
        return self.lesson(booking_id)


class LessonView(LessonBase):
    @reads("lesson_read", "Read a lesson and its line")
    def get(self, booking_id: UUID) -> LessonEntry:
        """For the people who share the booking, and who lead it."""
        return self.lesson(booking_id)


class JoinView(LessonBase):
    @_line("lesson_join", "Join the line of a lesson")
    def post(self, booking_id: UUID) -> LessonEntry:
        """The next in line is called when the robot is free; take control within 90 s then."""
        return self.step(booking_id, turns.turn_join, person=self.person)

    @_line("lesson_leave", "Leave the line of a lesson", keyed=False)
    def delete(self, booking_id: UUID) -> LessonEntry:
        """Of a person who drives, the turn ends."""
        return self.step(booking_id, turns.turn_leave, person=self.person)


class CallView(LessonBase):
    @_line("lesson_call", "Call a person next")
    def post(self, booking_id: UUID, body: CallNextRequest) -> LessonEntry:
        """For who leads the lesson. The person need not be in line. Who drives goes on."""
        self.one(booking_id)
        return self.step(booking_id, turns.turn_call, username=body.username, actor=self.person)


class FillView(LessonBase):
    @_line("lesson_fill", "Put everybody into the line")
    def post(self, booking_id: UUID) -> LessonEntry:
        """Those who had no turn yet, by name. For who leads the lesson."""
        return self.step(booking_id, turns.line_fill, actor=self.person)


class SpreadView(LessonBase):
    @_line("lesson_spread", "Spread the students over the robots of a lesson")
    def post(self, booking_id: UUID) -> LessonEntry:
        """Evenly over the lines of `at_once`: who waits, and who had no turn yet. For who leads the lesson."""
        return self.step(booking_id, line_spread, actor=self.person)


class TasksView(LessonBase):
    @_line("lesson_tasks", "Choose the tasks of a lesson", keyed=False)
    def put(self, booking_id: UUID, body: TasksRequest) -> LessonEntry:
        """Counts at once, for who drives, too; tasks that the lesson leaves out are refused with
        `not_in_lesson_tasks`. For who leads the lesson."""
        tasks = LessonTasks(**{name: getattr(body, name) for name in LessonTasks.__struct_fields__})
        facts: dict[str, Any] = {"tasks": tasks, "whole_series": body.whole_series}
        return self.step(booking_id, lesson_tasks_set, actor=self.person, **facts)


class HoldView(LessonBase):
    @_line("lesson_take_back", "Take the robot back from the line")
    def post(self, booking_id: UUID) -> LessonEntry:
        """The driver loses control within a second and waits first in line, with the rest of the turn; nobody is
        called. For who leads the lesson."""
        return self.step(booking_id, turns.line_hold, hold=True, actor=self.person)

    @_line("lesson_give_back", "Give the robot back to the line", keyed=False)
    def delete(self, booking_id: UUID) -> LessonEntry:
        """The next in line is called. For who leads the lesson."""
        return self.step(booking_id, turns.line_hold, hold=False, actor=self.person)


class TurnView(LessonBase):
    @_line("lesson_skip", "Skip a turn", keyed=False)
    def delete(self, booking_id: UUID, turn_id: int) -> LessonEntry:
        """The driver loses control within a second; the next person is called. For leaders of the lesson."""
        return self.step(booking_id, turns.turn_skip, turn_id=_bounded(turn_id), actor=self.person)

    @_line("lesson_extend", "Extend a turn")
    def post(self, booking_id: UUID, turn_id: int, body: ExtendRequest) -> LessonEntry:
        """For who leads the lesson."""
        facts = {"turn_id": _bounded(turn_id), "minutes": body.minutes}
        return self.step(booking_id, turns.turn_extend, actor=self.person, **facts)


def _bounded(number: int) -> int:
    """Return a number that the database takes as a key."""
    return min(number, 2**62)
