"""Turns in a shared booking: join the line, leave it, call, skip, extend, hold; begin and end of control.

Every change runs in a transaction that has locked the robot, as changes of bookings and of control do.
`control_begins`, `control_ends` and `turns_step` run in the transaction of `teleop.control`, which knows whether
the robot is free. What a change means for control follows from the stored turn: the rules of control permit the
person whose turn it is, and nobody else of the line.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from functools import partial
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models import Max, Min, QuerySet
from django.dispatch import Signal

from fleet.accounts.models import User
from fleet.audit.command_line import SystemAccount
from fleet.audit.services import record
from fleet.bookings.lessons.members import sharers_of, shares
from fleet.bookings.lessons.robots import why_nobody_is_called
from fleet.bookings.messages.moments import your_turn
from fleet.bookings.models import Booking, BookingMember, State, Turn
from fleet.bookings.permissions import may_manage_booking
from fleet.bookings.schedule import CALL_S, call_left_s
from fleet.bookings.services import BookingRefused, record_booking
from robots.access.selectors import missing_qualifications, role_on
from robots.registry.models import Robot, Role
from robots.registry.services import named
from robots.shared.sentences import say
from robots.shared.wire import Refusal

SHORTEST_S = 10.0  # a turn that is interrupted later than this before its end is over

OPEN = (Turn.State.CALLED, Turn.State.DRIVING)
ALIVE = (Turn.State.WAITING, *OPEN)

# Sent after the commit of a change of a line by a person; argument: robot_id. The next person may be called now.
line_changed = Signal()

_NO_LINE = Refusal("no_line", "This booking has no turns: take the robot when it is free.", "booking")
OVER = Refusal("over", "This booking is over.", "booking")
NOT_IN_IT = Refusal(
    "not_in_lesson",
    "Only people of this lesson or team take turns in it: ask its teacher, or book another time.",
    "account",
)
NOT_TEACHER = Refusal(
    "not_teacher",
    "Only the owner of the booking, a supervisor of its course or robot, or staff may do this: ask them.",
    "account",
)
_NO_TURN = Refusal("no_such_turn", "This turn is over, or its person has left the line.", "booking")


# --- the line: changes by people ---------------------------------------------------------------------


@contextmanager
def locked_line(booking_id: UUID, now: datetime, teacher: User | None = None) -> Iterator[Booking]:
    """Lock the robot of a booking with turns. Check that it is not over and, if given, that `teacher` leads it."""
    robot_id = Booking.objects.values_list("robot_id", flat=True).get(pk=booking_id)
    with transaction.atomic():
        robot = Robot.objects.select_for_update(of=("self",), no_key=True).select_related("profile")
        locked = robot.get(pk=robot_id)
        booking = Booking.objects.select_related("person", "course").get(pk=booking_id)
        booking.robot = locked
        if teacher is not None and not leads(teacher, booking):
            raise BookingRefused([NOT_TEACHER])
        if booking.state not in (State.BOOKED, State.AWAITING) or booking.held_until <= now:
            raise BookingRefused([OVER])
        if booking.turn_min is None:
            raise BookingRefused([_NO_LINE])
        yield booking
        transaction.on_commit(lambda: line_changed.send(sender=Turn, robot_id=robot_id))


def leads(person: User, booking: Booking) -> bool:
    """Return whether a person leads the line: the owner of the booking, and who manages it."""
    return booking.person_id == person.pk or may_manage_booking(person, booking)


def turn_join(*, booking_id: UUID, person: User, now: datetime) -> Turn:
    """Join the line. Who is in it already keeps the place. Raises `BookingRefused`."""
    with locked_line(booking_id, now) as booking:
        if not shares(booking, person):
            raise BookingRefused([NOT_IN_IT])
        found = booking.turns.filter(person=person, state__in=ALIVE).first()
        if found is not None:
            return found
        if (refusal := may_not_drive(booking, person, max(now, booking.starts_at))) is not None:
            raise BookingRefused([refusal])
        made = _append(booking, person)
        _record("turn.join", made, person)
    return made


def turn_leave(*, booking_id: UUID, person: User, now: datetime) -> None:
    """Leave the line. The turn of a person who drives, or drove, is done. Raises `BookingRefused`."""
    with locked_line(booking_id, now) as booking:
        for turn in booking.turns.filter(person=person, state__in=ALIVE):
            drove = turn.state == Turn.State.DRIVING or turn.left_s is not None
            _close(turn, Turn.State.DONE if drove else Turn.State.SKIPPED, now)
            _record("turn.leave", turn, person)


def line_fill(*, booking_id: UUID, actor: User, now: datetime) -> int:
    """Put everybody into the line who had no turn yet, by name. Return how many. Raises `BookingRefused`."""
    with locked_line(booking_id, now, actor) as booking:
        there = set(had_turn([booking]).values_list("person_id", flat=True))
        people = sorted(sharers_of([booking])[booking.pk], key=lambda one: one.display_name.lower())
        for person in (joined := [one for one in people if one.pk not in there]):
            _append(booking, person)
        if joined:
            ids = [str(person.pk) for person in joined]
            record("turn.fill", actor=actor, **named(booking.robot), parameters=_of(booking, people=ids))
    return len(joined)


def had_turn(bookings: Collection[Booking]) -> QuerySet[Turn]:
    """Return the turns of people who had one, or are in line; not of who might not drive when it was their turn."""
    return Turn.objects.filter(booking__in=bookings).exclude(state=Turn.State.REFUSED)


def turn_call(*, booking_id: UUID, username: str, actor: User, now: datetime) -> Turn:
    """Let this person drive next: put them first in line, and end a call of somebody else.

    Who drives goes on: skip their turn, or take control back, to change at once. Raises `BookingRefused`.
    """
    with locked_line(booking_id, now, actor) as booking:
        person = User.objects.filter(username=username, is_active=True).first()
        if person is None or not shares(booking, person):
            raise BookingRefused([NOT_IN_IT])
        turn = booking.turns.filter(person=person, state__in=ALIVE).first() or _append(booking, person)
        if turn.state == Turn.State.WAITING:
            for other in booking.turns.filter(state=Turn.State.CALLED):
                _wait_again(other, other.left_s)
            turn.number = _first_number(booking)
            turn.save()
        if booking.line_held:
            Booking.objects.filter(pk=booking.pk).update(line_held=None)
        _record("turn.call", turn, actor)
    return turn


def turn_skip(*, booking_id: UUID, turn_id: int, actor: User, now: datetime) -> None:
    """End a turn: the next person is called. Control of who drives ends within a second. Raises `BookingRefused`."""
    with locked_line(booking_id, now, actor) as booking:
        turn = _alive(booking, turn_id)
        drives = turn.state == Turn.State.DRIVING
        _close(turn, Turn.State.DONE if drives else Turn.State.SKIPPED, now)
        _record("turn.skip", turn, actor, why="teacher")


def turns_again(keys: Collection[int], actor: User | SystemAccount, now: datetime) -> list[Turn]:
    """Put people back into lines that skipped them, at their places. Return the turns of all who are in line.

    The caller has locked the robots.
    """
    mine = Turn.objects.filter(pk__in=keys, booking__state=State.BOOKED, booking__held_until__gt=now)
    found = []
    for turn in mine.select_related("person", "booking__person", "booking__robot", "booking__course"):
        others = turn.booking.turns.filter(person=turn.person, state__in=ALIVE)
        if turn.state in (Turn.State.SKIPPED, Turn.State.REFUSED) and not others.exists():
            turn.state, turn.called_at = Turn.State.WAITING, None
            turn.save()
            _record("turn.join", turn, actor, why="undo")
            changed = partial(line_changed.send, sender=Turn, robot_id=turn.booking.robot_id)
            transaction.on_commit(changed)
        if turn.state in ALIVE:
            found.append(turn)
    return found


def turn_extend(*, booking_id: UUID, turn_id: int, minutes: int, actor: User, now: datetime) -> None:
    """Make a turn longer. Raises `BookingRefused`."""
    with locked_line(booking_id, now, actor) as booking:
        _lengthen(_alive(booking, turn_id), booking, minutes)
        _record("turn.extend", _alive(booking, turn_id), actor, minutes=minutes)


def line_hold(*, booking_id: UUID, hold: bool, actor: User, now: datetime) -> None:
    """Take the robot back from the line, or give it back. Raises `BookingRefused`.

    While the line is held, nobody is called. Who drives waits first in line, with the rest of the turn.
    """
    with locked_line(booking_id, now, actor) as booking:
        if bool(booking.line_held) == hold:
            return
        Booking.objects.filter(pk=booking.pk).update(line_held=hold or None)
        for turn in booking.turns.filter(state__in=OPEN) if hold else ():
            _interrupt(turn, now)
        facts: dict[str, Any] = {**named(booking.robot), "parameters": _of(booking)}
        if hold:
            record("turn.hold", actor=actor, **facts)
        else:
            record("turn.go_on", actor=actor, **facts)


# --- begin and end of control ------------------------------------------------------------------------


def running(robot_id: UUID, now: datetime) -> Booking | None:
    """Return the booking that runs now."""
    found = Booking.objects.filter(robot=robot_id, state=State.BOOKED, starts_at__lte=now, held_until__gt=now)
    return found.select_related("course").first()


def slot_used(*, robot_id: UUID, person: User, now: datetime) -> Booking | None:
    """Note that a person has control: the present slot is used if they own or share it. Return the slot."""
    booking = running(robot_id, now)
    if booking is not None and booking.used_at is None and shares(booking, person):
        _store_use(booking, now)
    return booking


def may_take_back(*, robot: Robot, person: User, holder: tuple[UUID, Role] | None, now: datetime) -> bool:
    """Return whether a person takes control without a reason: in their slot, or in a lesson that they lead.

    `holder`: who has control, and in which role. Only people of the booking give it back unasked, no supervisor.
    """
    booking = running(robot.pk, now)
    if booking is None:
        return False
    booking.robot = robot
    if booking.person_id != person.pk and not (booking.shared and leads(person, booking)):
        return False
    if holder is None:
        return True
    who, role = holder
    return booking.person_id != who and role < Role.SUPERVISOR and shares(booking, User.objects.get(pk=who))


def control_handed(*, robot: Robot, giver: User, receiver: User, now: datetime) -> None:
    """Prepare the present slot for a receiver of control. The slot stays whose it is.

    Its owner makes the receiver a guest of the slot. In a lesson with turns, its teacher gives the receiver the turn;
    of a student, the turn ends, and the next in line is called.
    """
    booking = running(robot.pk, now)
    if booking is None:
        return
    booking.robot = robot
    if booking.turn_min is None:
        if booking.person_id == giver.pk and not shares(booking, receiver):
            BookingMember.objects.create(booking=booking, person=receiver)
            to = {"to": str(receiver.pk)}
            private = {"to_name": receiver.display_name}
            record_booking("booking.guest", booking, giver, parameters=to, private=private)
    elif leads(giver, booking) and shares(booking, receiver):
        for other in booking.turns.filter(state__in=OPEN).exclude(person=receiver):
            _interrupt(other, now)
        mine = booking.turns.filter(person=receiver, state__in=ALIVE).first() or _append(booking, receiver)
        if mine.state == Turn.State.WAITING:
            mine.state, mine.called_at = Turn.State.CALLED, now
            mine.save()
    else:
        control_ends(robot_id=robot.pk, person_id=giver.pk, given_up=True, now=now)
        _call_next(booking, now)


def control_begins(*, robot: Robot, person: User, now: datetime) -> None:
    """Note that a person has control in the present slot: it is used, and the turn of this person begins.

    Of others, an open turn is interrupted: the teacher, or a supervisor, took over.
    """
    booking = slot_used(robot_id=robot.pk, person=person, now=now)
    if booking is None or booking.turn_min is None:
        return
    booking.robot = robot
    member = shares(booking, person)
    for turn in booking.turns.filter(state__in=OPEN).exclude(person=person):
        _interrupt(turn, now)
    mine = booking.turns.filter(person=person, state__in=ALIVE).first()
    if leads(person, booking) and (mine is None or mine.state == Turn.State.WAITING):
        return  # drives as the teacher
    if mine is None and member:
        mine = _append(booking, person)
    if mine is not None and mine.state != Turn.State.DRIVING:
        ends_at = min(now + timedelta(seconds=_left_s(mine, booking)), booking.held_until)
        mine.state, mine.began_at, mine.ends_at = Turn.State.DRIVING, now, ends_at
        mine.save()


def control_ends(*, robot_id: UUID, person_id: UUID, given_up: bool, now: datetime) -> None:
    """Note that a person has no control any more. `given_up`: they gave it up, so their turn is done."""
    for turn in Turn.objects.filter(
        booking__robot=robot_id, person=person_id, state=Turn.State.DRIVING
    ).select_related("booking"):
        if given_up or turn.booking.held_until <= now:
            _close(turn, Turn.State.DONE, now)
        else:
            _interrupt(turn, now)


def turns_step(*, robot: Robot, now: datetime) -> bool:
    """Do what the clock demands, on a robot that nobody controls. Return whether something changed.

    Who was called and did not come is put one place back, once. Then the next person is called. While nobody can drive
    the robot, who was called waits first in line.
    """
    booking = running(robot.pk, now)
    if booking is None or booking.turn_min is None:
        return False
    booking.robot = robot
    opened = booking.turns.filter(state__in=OPEN).select_related("person").first()
    if opened is not None and opened.state == Turn.State.DRIVING:  # control ended without its turn
        _interrupt(opened, now)
    elif opened is not None and why_nobody_is_called(booking, now):
        _interrupt(opened, now)
        _record("turn.wait", opened, None)
        return True
    elif opened is not None:
        if call_left_s(opened.called_at or now, now) > 0.0:
            return False
        _miss(opened, now)
    return _call_next(booking, now) or opened is not None


def turns_due(now: datetime) -> QuerySet[Robot]:
    """Return the robots on which a line waits now, or somebody is called."""
    turns = Turn.objects.filter(
        state__in=(Turn.State.WAITING, Turn.State.CALLED),
        booking__state=State.BOOKED,
        booking__starts_at__lte=now,
        booking__held_until__gt=now,
    )
    return Robot.objects.filter(pk__in=turns.values("booking__robot").distinct().order_by())


def turn_lengthen_running(*, robot: Robot, person: User, now: datetime) -> bool:
    """Lengthen the turn of the person who drives by another turn. Return False if they drive no turn.

    Refused while somebody waits. Raises `BookingRefused`.
    """
    booking = running(robot.pk, now)
    if booking is None or booking.turn_min is None:
        return False
    turn = booking.turns.filter(person=person, state=Turn.State.DRIVING).first()
    if turn is None:
        return False
    if (other := booking.turns.filter(state=Turn.State.WAITING).select_related("person").first()) is not None:
        text = say(
            "{name} waits for a turn, so yours is not extended. Release control, or drive until it ends.",
            name=other.person.display_name,
        )
        raise BookingRefused([Refusal("somebody_waits", text, "booking")])
    _lengthen(turn, booking, booking.turn_min)
    return True


def _store_use(booking: Booking, now: datetime) -> None:
    Booking.objects.filter(pk=booking.pk, used_at=None).update(used_at=now)


def _call_next(booking: Booking, now: datetime) -> bool:
    """Call the next person who may drive. Return whether somebody is called.

    Who waits for a robot that nobody can drive uses the slot: others do not get it.
    """
    if booking.line_held:
        return False
    waiting = booking.turns.filter(state=Turn.State.WAITING).select_related("person")
    if why_nobody_is_called(booking, now):
        if booking.used_at is None and waiting.exists():
            _store_use(booking, now)
        return False
    for turn in waiting:
        turn.booking = booking
        if (refusal := may_not_drive(booking, turn.person, now)) is not None:
            _close(turn, Turn.State.REFUSED, now)
            _record("turn.skip", turn, None, why=refusal.code)
            continue
        turn.state, turn.called_at = Turn.State.CALLED, now
        turn.save()
        _store_use(booking, now)
        _record("turn.call", turn, None, seconds=CALL_S)
        your_turn(turn, now)
        return True
    return False


def may_not_drive(booking: Booking, person: User, at: datetime) -> Refusal | None:
    """Return why this person cannot drive in the booking at this moment."""
    robot = booking.robot
    role = role_on(person, robot, at)
    if not shares(booking, person):
        return NOT_IN_IT
    if booking.tasks and booking.tasks.get("watch") and not leads(person, booking):
        text = say("In this lesson of {name} you watch: the teacher drives.", name=booking.lesson_of)
        return Refusal("only_watching", text, "booking")
    if role is None or role < Role.OPERATOR:
        key = "You may not drive {robot} during this time: ask the staff, or your course’s supervisor."
        return Refusal("role_too_low", say(key, robot=robot.name), "account")
    if missing := missing_qualifications(person, robot, at):
        names = ", ".join(one.name for one in missing)
        key = "{robot} demands {names}. Ask the staff or your course’s supervisor for it."
        text = say(key, robot=robot.name, names=names)
        return Refusal("unqualified", text, "account", {"missing": names})
    return None


def _miss(turn: Turn, now: datetime) -> None:
    """Note that a called person did not come: one place back the first time, out of the line the second."""
    turn.misses += 1
    if turn.misses > 1:
        _close(turn, Turn.State.MISSED, now)
    else:
        behind = turn.booking.turns.filter(state=Turn.State.WAITING).first()
        _wait_again(turn, turn.left_s)
        if behind is not None:
            Turn.objects.filter(pk=behind.pk).update(number=_first_number(turn.booking))
    _record("turn.miss", turn, None, outcome=turn.state)


def _interrupt(turn: Turn, now: datetime) -> None:
    """Put an open turn first in line again, with its rest; or end it if hardly anything is left."""
    if turn.state == Turn.State.CALLED or turn.ends_at is None:
        _wait_again(turn, turn.left_s)
        return
    left_s = (turn.ends_at - now).total_seconds()
    if left_s < SHORTEST_S:
        _close(turn, Turn.State.DONE, now)
    else:
        _wait_again(turn, round(left_s))


def _wait_again(turn: Turn, left_s: int | None) -> None:
    turn.number = _first_number(turn.booking)
    turn.state, turn.left_s = Turn.State.WAITING, left_s
    turn.called_at = turn.began_at = turn.ends_at = None
    turn.save()


def _close(turn: Turn, state: Turn.State, now: datetime) -> None:
    if turn.state == Turn.State.DRIVING:
        turn.ends_at = min(turn.ends_at or now, now)
    turn.state = state
    turn.save()


def _lengthen(turn: Turn, booking: Booking, minutes: int) -> None:
    if turn.ends_at is not None:
        turn.ends_at += timedelta(minutes=minutes)
    else:
        turn.left_s = _left_s(turn, booking) + 60 * minutes
    turn.save()


def _left_s(turn: Turn, booking: Booking) -> int:
    """Return how long a turn lasts from its begin."""
    return 60 * (booking.turn_min or 0) if turn.left_s is None else turn.left_s


def _alive(booking: Booking, turn_id: int) -> Turn:
    turn = booking.turns.filter(pk=turn_id, state__in=ALIVE).select_related("person").first()
    if turn is None:
        raise BookingRefused([_NO_TURN])
    turn.booking = booking
    return turn


def _append(booking: Booking, person: User) -> Turn:
    last = booking.turns.aggregate(last=Max("number"))["last"] or 0
    return Turn.objects.create(booking=booking, person=person, number=last + 1)


def _first_number(booking: Booking) -> int:
    first = booking.turns.filter(state__in=ALIVE).aggregate(first=Min("number"))["first"]
    return (1 if first is None else first) - 1


def _of(booking: Booking, **facts: Any) -> dict[str, Any]:
    return {"booking": str(booking.pk), **facts}


def _record(
    kind: str, turn: Turn, actor: User | SystemAccount | None, outcome: str = "", **facts: Any
) -> None:
    """Record a change of a turn. `actor` None: the console."""
    booking, person = turn.booking, turn.person
    record(
        kind,
        actor=actor,
        **named(booking.robot),
        outcome=outcome,
        parameters=_of(booking, person=str(person.pk), **facts),
        private={"person_name": person.display_name},
    )
