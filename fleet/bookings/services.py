"""All changes of bookings. Each change and its audit record are one transaction.

Every change first locks the robot's row, then checks, then writes. The database's own constraint (`overlaps`)
finally refuses overlaps. A change that is not allowed raises `BookingRefused` with all its refusals. Free time
is offered to the people who wait for it (`settling`) before anybody else can book it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime, timedelta
from functools import partial
from typing import Any
from uuid import UUID

from django.db import IntegrityError, connection, transaction
from django.db.models import Count, F, Q
from django.dispatch import Signal
from django.utils import timezone
from django.utils.translation import gettext as _
from msgspec import structs

from fleet.accounts.models import User
from fleet.audit.command_line import SystemAccount
from fleet.audit.models import Record
from fleet.audit.services import RecordBody, record, record_all
from fleet.base.database.rows import write_all
from fleet.base.names import fault_of
from fleet.bookings import overlaps
from fleet.bookings.free_time import free_slots
from fleet.bookings.messages.notifications import changed_by_another
from fleet.bookings.models import Booking, BookingMember, Shared, State
from fleet.bookings.permissions import may_book_for, may_learn_of, may_manage_booking
from fleet.bookings.rules import (
    BINDING,
    LONGEST,
    REST,
    RULES,
    Rule,
    Slot,
    Wish,
    check_cancel,
    refusals,
)
from fleet.bookings.selectors import (
    NOT_YET,
    RobotFacts,
    Stage,
    courses_for,
    grace_of,
    held_between,
    held_slot,
    out_between,
    policy_of,
    robot_facts,
    stage_of,
    wish_of,
)
from robots.access.models import Course
from robots.access.selectors import manages_robot, may_manage, missing_qualifications, role_on
from robots.registry.models import Robot, Role
from robots.registry.services import named
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal

LENGTHENED_BY = timedelta(minutes=15)
# Housekeeping notes that nobody used a slot as soon as its grace time is over, if it has watched the clock since before
# the slot began. It cannot know that of earlier slots: if a computer starts with its clock set to local time instead of
# UTC, the clock is at most 14 hours ahead, and slots that have not begun must not be freed. So it notes those later,
# until three days after their end. `restore_unbegun` puts right what was noted before a clock was set back.
NOTED_AFTER = timedelta(hours=14)
NOTED_UNTIL = timedelta(days=3)
LEAST_GRACE = timedelta(minutes=5)  # of any policy
CANCELLED_KEPT = timedelta(days=400)  # the report of a term counts cancelled bookings
MOST_CANCELLED = 500  # of one person
REMOVED_AT_ONCE = 10_000
MOST_IN_TEAM = 4  # with the owner of the booking
MOST_TURN_MIN = 240
TIMES = ("state", "ends_at", "held_until", "offer_until")
_SAVE_TIMES = """
UPDATE bookings_booking SET state = %s, ends_at = %s, held_until = %s, offer_until = %s, version = %s, changed_at = %s
WHERE id = %s
"""  # for many bookings; `bulk_update` takes ten times as long, and others wait

changed = Signal()  # sent after the commit of a change of a robot's bookings; argument: robot_id
# Sent inside each transaction that locks a robot's bookings, before and after its change; arguments: robot, now.
# Before: the clock, a policy or a right may have freed time. After: the change itself may have.
settling = Signal()


class BookingRefused(NotDone):
    """A change of a booking is not allowed.

    `refusals` has every reason; `wish` has the facts, if a rule refused.

    `asked` has the arguments of `wish_of` except the slot. With them, other slots are checked. `alternatives`: slots
    to choose from, if the refusal itself knows them.
    """

    def __init__(
        self,
        refusals: list[Refusal],
        wish: Wish | None = None,
        asked: dict[str, Any] | None = None,
        alternatives: Sequence[tuple[Robot, Slot]] = (),
    ) -> None:
        super().__init__(refusals[0])
        self.alternatives = list(alternatives)
        self.refusals = refusals
        self.wish = wish
        self.asked = asked or {}


_OVER = {
    Stage.OVER: say("This booking is over."),
    Stage.FINISHED: say("This booking is finished early."),
    Stage.NO_SHOW: say("This booking is not used."),
    Stage.CANCELLED: say("This booking is cancelled."),
}
_TAKEN = Refusal("taken", "Another person has just booked this time. Choose another one.", "booking")
_STALE = Refusal(
    "changed",
    "This booking was changed meanwhile, in another tab or by the staff. Look at it again.",
    "booking",
)
NOT_YOURS = Refusal(
    "not_yours",
    "Only its owner, a supervisor of the robot or of the booking’s course, or staff may change it.",
    "account",
)
_OFFERED = Refusal(
    "offered",
    "This time is only offered: the person who waited for it accepts or declines it first.",
    "booking",
)
_NO_ACCOUNT = Refusal(
    "no_account",
    "Nobody for whom you may book has this user name. Look at the name, or ask the staff.",
    "booking",
)
_FOR_ANOTHER = Refusal(
    "not_for_others",
    "You may book this robot for people of your own courses only. Ask a supervisor of the robot, or staff.",
    "account",
)


_TEAM_SIZE = Refusal(
    "team_size",
    "A team has two to four people, each named once: leave some out, or ask a teacher for a lesson of the course.",
    "booking",
    {"most": MOST_IN_TEAM},
)
_LESSON_OR_TEAM = Refusal(
    "invalid", "A booking is for a course or for named people, not for both: choose one.", "booking"
)
_NO_TURNS = Refusal(
    "invalid", "Turns need a course or named people: choose who shares the booking.", "booking"
)
_TURN_LENGTH = Refusal(
    "invalid", "A turn lasts 1 to 240 minutes: choose another length.", "booking", {"most": MOST_TURN_MIN}
)


@contextmanager
def robots_locked(keys: Iterable[UUID], now: datetime) -> Iterator[None]:
    """Lock several robots as `robot_locked` does, in one order, so that no two changes wait for each other."""
    with ExitStack() as locks:
        for key in sorted(keys):
            locks.enter_context(robot_locked(key, now))
        yield


@contextmanager
def robot_locked(robot_id: UUID, now: datetime) -> Iterator[Robot]:
    """Open a transaction in which nobody else changes the robot's bookings. Return the robot.

    The transaction also offers the robot's free time to the people who wait for it.

    Raises `BookingRefused` if the database's constraint finds an overlap.
    """
    try:
        with transaction.atomic():
            robot = (
                Robot.objects.select_for_update(of=("self",), no_key=True)
                .select_related("profile")
                .get(pk=robot_id)
            )
            settling.send(sender=Booking, robot=robot, now=now)
            yield robot
            settle(robot, now)
    except IntegrityError as error:
        if overlaps.NAME not in str(error):
            raise
        raise BookingRefused([_TAKEN]) from error


def settle(robot: Robot, now: datetime) -> None:
    """Offer the robot's free time after a change, and report the change. The caller has locked the robot."""
    settling.send(sender=Booking, robot=robot, now=now)
    transaction.on_commit(partial(changed.send, sender=Booking, robot_id=robot.pk))


def account_named(username: str, actor: User, robot: Robot, at: datetime) -> User:
    """Return the person to book for, if the actor may learn of the account. Raises `BookingRefused`.

    The refusal is the same for a missing account and for an account of which the actor may not learn.
    """
    found = User.objects.filter(username=username, is_active=True).first()
    if found is not None and may_learn_of(actor, found, robot, at):
        return found
    raise BookingRefused([_NO_ACCOUNT if manages_robot(actor, robot) else _FOR_ANOTHER])


def colleague_named(username: str, actor: User, booking: Booking) -> User:
    """Return the person to whom a booking shall be handed. Raises `BookingRefused`.

    The refusal is the same for a missing account and for a person who may not drive the robot. Supervisors
    who may learn of the account get the person here, and later the refusals of the rules.
    """
    manages = may_manage_booking(actor, booking)
    if booking.person_id != actor.pk and not manages:
        raise BookingRefused([NOT_YOURS])
    found = User.objects.filter(username=username, is_active=True).first()
    role = role_on(found, booking.robot, booking.starts_at) if found else None
    drives = role is not None and role >= Role.OPERATOR
    known = found is not None and manages and may_learn_of(actor, found, booking.robot, booking.starts_at)
    if found is None or not (drives or known):
        key = "Nobody with the user name {name} may drive {robot} at this time."
        text = say(key, name=username, robot=booking.robot.name)
        raise BookingRefused([Refusal("no_colleague", text, "booking")])
    return found


def alternatives_of(error: BookingRefused) -> list[tuple[Robot, Slot]]:
    """Return the next free slots of the robot if the time is taken.

    They are as long as the wished slot, or as long as the policy allows.
    """
    if error.alternatives:
        return error.alternatives
    if (wish := error.wish) is None or "taken" not in (refusal.code for refusal in error.refusals):
        return []
    minutes = min(wish.slot.minutes, wish.policy.longest_min)
    return free_slots(minutes=minutes, after=wish.slot.starts_at, wish=wish, **error.asked)


def booking_make(
    *,
    robot: Robot,
    person: User,
    slot: Slot,
    now: datetime,
    purpose: str = "",
    actor: User | None = None,
    override: str = "",
    series: UUID | None = None,
    lesson_of: Course | None = None,
    course: Course | None = None,
    team: Sequence[User] = (),
    asked: Sequence[User] = (),
    turn_min: int | None = None,
    record_it: bool = False,
    facts: Callable[[Robot, Slot], RobotFacts] = robot_facts,
) -> Booking:
    """Book a slot for a person. Raises `BookingRefused`.

    `actor`: the person who books; default: the person for whom the slot is.
    `override`: the reason to book against the policy; only for people who manage the robot.
    `lesson_of`: the slot is a lesson of this course, which the actor manages: its people share it. Lessons do not
    count for the quotas of bookings.
    `team`: other people who share the slot; those `asked` do when they accept. It counts for `person` alone.
    `turn_min`: who shares the slot takes turns of so many minutes; None: each takes the robot when it is free.
    `course`: the course for which the slot counts, if several courses let the person drive the robot.
    `record_it`: the slot is recorded. `facts`: reads the robot's facts before the lock (`shared_facts.in_turn`).
    """
    actor = actor or person
    leads = lesson_of is None or may_manage(actor, lesson_of)
    if not (leads and may_book_for(actor, person, robot, slot.starts_at)):
        raise BookingRefused([_FOR_ANOTHER])
    require_readable(purpose)
    require_shareable(robot, person, team, turn_min, slot.starts_at, lesson=lesson_of is not None)
    override = _valid_reason(override, actor, robot)
    course = course or _course_of_teacher(actor, robot, person, slot)
    checked: dict[str, Any] = {"actor": actor, "override": override, "course": course}
    checked["lesson"] = lesson_of is not None
    # First check without the lock: many people may be too late for a slot, and must not wait for each other.
    _check(robot, person, slot, now, **checked, facts=facts(robot, slot))
    with robot_locked(robot.id, now) as robot:
        free_unused(robot, slot, now)
        quotas_locked(robot, person, slot)
        course = _check(robot, person, slot, now, **checked)
        booking = Booking.objects.create(
            robot=robot,
            person=person,
            starts_at=slot.starts_at,
            ends_at=slot.ends_at,
            held_until=slot.ends_at,
            state=state_for(actor, robot, lesson_of or course),
            purpose=purpose,
            series=series,
            course=lesson_of or course,
            shared=Shared.COURSE if lesson_of else Shared.PEOPLE if team else Shared.NO,
            turn_min=turn_min,
            record=record_it or None,
            made_at=now,
            overridden=bool(override) or None,
        )
        how = _store_team(booking, [one for one in team if one not in asked])
        record_booking("booking.make", booking, actor, outcome=booking.state, text=override, parameters=how)
    return booking


def _course_of_teacher(actor: User, robot: Robot, person: User, slot: Slot) -> Course | None:
    """Return the course by which a teacher books for a student; None: the actor needs none."""
    if actor.pk == person.pk or manages_robot(actor, robot):
        return None
    return next((one for one in courses_for(robot, person, slot.starts_at) if may_manage(actor, one)), None)


def _store_team(booking: Booking, team: Sequence[User]) -> dict[str, Any]:
    """Store the people who share a new booking. Return, for its record, how it is shared."""
    BookingMember.objects.bulk_create(BookingMember(booking=booking, person=one) for one in team)
    facts: dict[str, Any] = {"shared": booking.shared} if booking.shared else {}
    if team:
        facts["team"] = [str(one.pk) for one in team]
    if booking.turn_min is not None:
        facts["turn_min"] = booking.turn_min
    return facts


def booking_move(
    *,
    booking_id: UUID,
    version: int,
    slot: Slot,
    actor: User,
    now: datetime,
    override: str = "",
    robot: Robot | None = None,
) -> Booking:
    """Move or lengthen a booking. `version`: the version that the person saw. Raises `BookingRefused`.

    `robot`: another robot, which the caller has locked together with the booking's own.
    """
    with changeable(booking_id, actor, version, now) as booking:
        require_accepted(booking)
        if now >= booking.starts_at:  # the booking runs: its start cannot change
            slot = Slot(booking.starts_at, slot.ends_at)
        before = {"from": booking.starts_at.isoformat(), "to": booking.ends_at.isoformat()}
        if (robot := robot or booking.robot) != booking.robot:
            before["robot"] = booking.robot.slug
            if not may_book_for(actor, booking.person, robot, slot.starts_at):
                raise BookingRefused([_FOR_ANOTHER])
        override = _valid_reason(override, actor, robot)
        free_unused(robot, slot, now, but=booking)
        quotas_locked(robot, booking.person, slot)
        lesson = booking.shared == Shared.COURSE
        if "robot" in before and booking.shared == Shared.PEOPLE:
            team = [one.person for one in booking.members.select_related("person")]
            require_shareable(robot, booking.person, team, booking.turn_min, slot.starts_at, lesson=False)
        old = Slot(booking.starts_at, booking.ends_at)
        late = _late_to_cancel(booking, actor, now)
        gives_up = "robot" in before or not old.within(slot)
        course = _check(
            robot,
            booking.person,
            slot,
            now,
            actor=actor,
            override=override,
            moved=booking,
            lesson=lesson,
            also=late if gives_up else None,
            stays=late is not None or now >= booking.starts_at,
        )
        booking.robot = robot
        if (
            booking.state == State.BOOKED
            and now < old.starts_at
            and ("robot" in before or not slot.within(old))
        ):
            booking.state = state_for(actor, robot, booking.course)
        if slot.starts_at != old.starts_at:
            booking.reminded_at, booking.made_at = None, now
            if not lesson:
                booking.course = course
        booking.starts_at, booking.ends_at, booking.held_until = slot.starts_at, slot.ends_at, slot.ends_at
        booking.overridden = bool(override) or None  # None: every rule allows it now
        save_booking(booking)
        record_booking("booking.move", booking, actor, text=override, parameters={"before": before})
        changed_by_another(booking, actor, lambda: _("moved"), now, lambda: override, times=True)
    return booking


def booking_cancel(
    *, booking_id: UUID, version: int, actor: User, now: datetime, reason: str = ""
) -> Booking:
    """Cancel a booking. A booking that has begun is finished: the rest is free at once.

    Raises `BookingRefused`.
    """
    require_readable(reason)
    with changeable(booking_id, actor, version, now) as booking:
        if (refusal := _late_to_cancel(booking, actor, now)) is not None:
            raise BookingRefused([refusal])
        begun = now > booking.starts_at and booking.state not in NOT_YET
        booking.state = State.FINISHED if begun else State.CANCELLED
        booking.held_until = now if begun else booking.starts_at
        save_booking(booking)
        record_booking("booking.cancel", booking, actor, outcome=booking.state, text=reason)
        changed_by_another(booking, actor, lambda: _("cancelled"), now, lambda: reason, times=True)
    return booking


def booking_hand(*, booking_id: UUID, version: int, to: User, actor: User, now: datetime) -> Booking:
    """Hand a booking to a colleague. The rules must allow it for the colleague. Raises `BookingRefused`.

    Of a slot that runs, hand the rest, as a new booking.
    """
    with changeable(booking_id, actor, version, now) as booking:
        require_accepted(booking)
        if to == booking.person:
            text = say("This is the booking of {name} already.", name=to.display_name)
            raise BookingRefused([Refusal("invalid", text, "booking")])

        def handed() -> str:
            return _("handed to %(name)s") % {"name": to.display_name}

        if booking.state == State.BOOKED and now > booking.starts_at:
            changed_by_another(booking, actor, handed, now, gone=True)
            booking = _hand_rest(booking, to, actor, now)
            changed_by_another(booking, actor, lambda: _("handed to you"), now)
            return booking
        slot = Slot(booking.starts_at, booking.ends_at)
        quotas_locked(booking.robot, to, slot)
        lesson = _is_lesson_of(to, booking)
        course = _check(booking.robot, to, slot, now, actor=actor, moved=booking, lesson=lesson)
        before = booking.person
        changed_by_another(booking, actor, handed, now, gone=True)
        booking.person, booking.overridden = to, None
        if not lesson:  # a student's slot is no lesson: it counts for quotas
            booking.course, booking.series = course, None
        _reshare(booking, before, lesson=lesson)
        if booking.state == State.BOOKED and now < booking.starts_at:
            booking.state = state_for(actor, booking.robot, booking.course)
        save_booking(booking)
        parameters = {"before": {"person": str(before.pk)}}
        record_booking(
            "booking.hand", booking, actor, parameters=parameters, private={"before": before.display_name}
        )
        changed_by_another(booking, actor, lambda: _("handed to you"), now)
    return booking


def booking_approve(*, booking_id: UUID, version: int, actor: User, now: datetime) -> Booking:
    """Approve a booking that awaits approval; its times must be those that the approver saw."""
    with changeable(booking_id, actor, version, now) as booking:
        if not may_manage_booking(actor, booking):
            raise BookingRefused([NOT_YOURS])
        if booking.state == State.AWAITING:
            booking.state, booking.made_at = State.BOOKED, now  # others could take control until now
            save_booking(booking)
            record_booking("booking.approve", booking, actor)
            changed_by_another(booking, actor, lambda: _("approved"), now)
    return booking


def booking_lengthen_running(*, robot: Robot, person: User, now: datetime) -> None:
    """Lengthen a person's current slot by `LENGTHENED_BY`. Runs in the caller's transaction.

    If several slots of the person follow each other without a gap, lengthen the last one. Raises
    `BookingRefused`.
    """
    mine = Booking.objects.filter(robot=robot, person=person, state=State.BOOKED, held_until__gt=now)
    last: Booking | None = None
    for booking in mine.order_by("starts_at"):
        if booking.starts_at > (last.held_until if last else now):
            break
        last = booking
    if last is not None:
        slot = Slot(last.starts_at, last.ends_at + LENGTHENED_BY)
        booking_move(booking_id=last.pk, version=last.version, slot=slot, actor=person, now=now)


def _hand_rest(booking: Booking, to: User, actor: User, now: datetime) -> Booking:
    """Hand the rest of a slot that runs to another person, as a new booking. Raises `BookingRefused`.

    The time that has passed stays with the person who had it, and counts for that person's quotas. The
    receiver's quotas must have room for the rest, also if the receiver had the slot before. The rest of a
    lesson stays a lesson for people of its course and who manage the booking: no quota counts it.
    """
    rest, before = Slot(now, booking.ends_at), booking.person
    lesson = _is_lesson_of(to, booking)
    quotas_locked(booking.robot, to, rest)
    asked: dict[str, Any] = {"actor": actor, "moved": booking, "lesson": lesson, "stays": True}
    course = _check(booking.robot, to, rest, now, rules=REST, **asked)
    handed = Booking(
        robot=booking.robot,
        person=to,
        starts_at=now,
        ends_at=rest.ends_at,
        held_until=rest.ends_at,
        purpose=booking.purpose,
        series=booking.series if lesson else None,
        course=booking.course if lesson else course,
        shared=booking.shared,
        turn_min=booking.turn_min,
        tasks=booking.tasks,
        record=booking.record,
        made_at=now,
    )
    booking.held_until = now
    if now > booking.starts_at:
        booking.ends_at, booking.state = now, State.FINISHED  # its giver did not stay away
    else:  # nothing of it has passed
        booking.state = State.CANCELLED
    save_booking(booking)
    handed.save(force_insert=True)
    for rows in (booking.members, booking.turns):
        rows.update(booking=handed)
    _reshare(handed, before, lesson=lesson)
    handed.save()
    parameters = {"before": {"person": str(before.pk), "booking": str(booking.pk)}}
    record_booking(
        "booking.hand", handed, actor, parameters=parameters, private={"before": before.display_name}
    )
    return handed


@contextmanager
def changeable(booking_id: UUID, actor: User, version: int, now: datetime) -> Iterator[Booking]:
    """Lock a booking's robot. Check that this person may change the booking and saw its latest version."""
    robot_id = Booking.objects.values_list("robot_id", flat=True).get(pk=booking_id)
    with robot_locked(robot_id, now) as robot:
        booking = Booking.objects.select_related("person", "robot", "course").get(pk=booking_id)
        booking.robot = robot
        if booking.person_id != actor.pk and not may_manage_booking(actor, booking):
            raise BookingRefused([NOT_YOURS])
        if booking.version != version:
            raise BookingRefused([_STALE])
        stage = stage_of(booking, grace_of(policy_of(robot)), now)
        if stage in _OVER:
            raise BookingRefused([Refusal("over", _OVER[stage], "booking")])
        yield booking


def require_accepted(booking: Booking) -> None:
    """Refuse to move or hand on a slot that is only offered: other people may wait for it."""
    if booking.state == State.OFFERED:
        raise BookingRefused([_OFFERED])


def save_booking(booking: Booking) -> None:
    """Save a change of a booking under a new version. The caller has locked the robot."""
    booking.version += 1
    booking.save()


def save_times(bookings: Sequence[Booking]) -> None:
    """Save the state and times of many bookings under new versions. The caller has locked their robots."""
    for booking in bookings:
        booking.version += 1
        booking.changed_at = timezone.now()
    names = (*TIMES, "version", "changed_at", "pk")
    write_all(_SAVE_TIMES, [[getattr(booking, name) for name in names] for booking in bookings])


def quotas_locked(robot: Robot, person: User, slot: Slot) -> None:
    """Lock, until the commit, the quotas of a person, and of the courses for which a slot may count.

    The lock on the robot is not enough: a person, or people of a course, may book several robots at the same
    moment. SQLite needs no such lock: it has one writer at a time.
    """
    if connection.vendor == "postgresql":
        shared = [
            one.pk for one in courses_for(robot, person, slot.starts_at) if one.course_week_min is not None
        ]
        keys = [f"bookings of person {person.pk}", *(f"bookings of course {key}" for key in sorted(shared))]
        with connection.cursor() as cursor:
            for key in keys:
                cursor.execute("SELECT pg_advisory_xact_lock(hashtext(%s))", [key])


def _check(
    robot: Robot,
    person: User,
    slot: Slot,
    now: datetime,
    *,
    actor: User,
    override: str = "",
    moved: Booking | None = None,
    course: Course | None = None,
    lesson: bool = False,
    facts: RobotFacts | None = None,
    also: Refusal | None = None,
    stays: bool = False,
    rules: Sequence[Rule] = RULES,
) -> Course | None:
    """Check a wish. Return the course for which the slot counts, or raise `BookingRefused` with all refusals.

    `also`: a further refusal.
    `stays`: the booking cannot get another start, so no other times are proposed.
    `override`: the reason of a person who may book against the policy. Other arguments: see `wish_of`.

    If `actor` is not `person`, the texts name the person.
    """
    asked: dict[str, Any] = {
        "robot": robot,
        "person": person,
        "now": now,
        "moved": moved,
        "course": course,
        "lesson": lesson,
    }
    wish = wish_of(**asked, slot=slot, facts=facts)
    if moved is not None and moved.starts_at == slot.starts_at:
        wish = structs.replace(wish, start_kept=True)
    found = refusals(wish, BINDING if override else rules) + ([also] if also else [])
    if actor.pk != person.pk:
        found = [
            structs.replace(one, text=say("For {name}: {text}", name=person.display_name, text=one.sentence))
            for one in found
        ]
    if found:
        raise BookingRefused(found, None if stays else wish, asked)
    return wish.course


def check_offer(booking: Booking, actor: User, now: datetime) -> Course | None:
    """Check that the person of an offer may use it, and that their quotas have room for it.

    The slot itself was checked when it was offered. Return the course for which it counts. Raises
    `BookingRefused`.
    """
    slot = Slot(booking.starts_at, booking.ends_at)
    quotas_locked(booking.robot, booking.person, slot)
    asked: dict[str, Any] = {"actor": actor, "moved": booking, "stays": True}
    return _check(booking.robot, booking.person, slot, now, rules=REST, **asked)


def _valid_reason(override: str, actor: User, robot: Robot) -> str:
    """Return the reason to book against the policy; blank if this person may not do that."""
    require_readable(override)
    return override if override and manages_robot(actor, robot) else ""


def require_readable(text: str) -> None:
    """Raise `BookingRefused` if others cannot see all of a person's words."""
    if fault := fault_of(text):
        raise BookingRefused([Refusal(fault.code, str(fault.text), "wire")])


def _late_to_cancel(booking: Booking, actor: User, now: datetime) -> Refusal | None:
    """Return a refusal if the time may not be given up any more under the policy.

    People who manage the booking need no notice. An offer, or a booking without approval, may be given up at
    any time.
    """
    if booking.state in NOT_YET:
        return None
    slot = Slot(booking.starts_at, booking.held_until)
    refusal = check_cancel(slot, policy_of(booking.robot), now)
    if refusal is not None and refusal.code == "late_to_cancel" and may_manage_booking(actor, booking):
        return None
    return refusal


def _reshare(booking: Booking, before: User, *, lesson: bool) -> None:
    """Fit who shares a booking to its new owner. A student's slot is no lesson; a team keeps its former owner."""
    if booking.shared == Shared.COURSE and not lesson:
        booking.shared, booking.turn_min, booking.line_held, booking.tasks = Shared.NO, None, None, None
        booking.turns.all().delete()
    booking.members.filter(person=booking.person).delete()
    if booking.shared == Shared.PEOPLE:
        booking.members.get_or_create(person=before)


def require_shareable(
    robot: Robot, person: User, team: Sequence[User], turn_min: int | None, at: datetime, *, lesson: bool
) -> None:
    """Check the people of a team, and the length of turns. Raises `BookingRefused`."""
    found: list[Refusal] = []
    if team and lesson:
        found.append(_LESSON_OR_TEAM)
    if team and (len({person.pk, *(one.pk for one in team)}) != len(team) + 1 or len(team) >= MOST_IN_TEAM):
        found.append(_TEAM_SIZE)
    if turn_min is not None and not (team or lesson):
        found.append(_NO_TURNS)
    if turn_min is not None and not 1 <= turn_min <= MOST_TURN_MIN:
        found.append(_TURN_LENGTH)
    for one in team:
        role = role_on(one, robot, at)
        if role is None or role < Role.OPERATOR or missing_qualifications(one, robot, at):
            text = say("{name} may not drive {robot} at this time.", name=one.display_name, robot=robot.name)
            found.append(Refusal("may_not_drive", text, "booking"))
    if found:
        raise BookingRefused(found)


def team_named(usernames: Sequence[str], robot: Robot, at: datetime) -> list[User]:
    """Return the people of a team by their user names. Raises `BookingRefused`.

    The refusal is the same for a missing account and for a person who may not drive the robot.
    """
    people = {one.username: one for one in User.objects.filter(username__in=usernames, is_active=True)}
    found = []
    for username in dict.fromkeys(usernames):
        person = people.get(username)
        role = role_on(person, robot, at) if person else None
        if person is None or role is None or role < Role.OPERATOR:
            key = "Nobody with the user name {name} may drive {robot} at this time."
            raise BookingRefused(
                [Refusal("no_colleague", say(key, name=username, robot=robot.name), "booking")]
            )
        found.append(person)
    return found


def _is_lesson_of(person: User, booking: Booking) -> bool:
    """Return whether the booking is a lesson of a course, and stays a lesson if this person has it."""
    course = booking.course if booking.shared == Shared.COURSE else None
    return course is not None and may_manage(person, course)


def state_for(actor: User, robot: Robot, course: Course | None) -> State:
    """Return the state of a slot that this person books: for some robots, a supervisor must approve it."""
    if not policy_of(robot).needs_approval or manages_robot(actor, robot):
        return State.BOOKED
    return State.BOOKED if course is not None and may_manage(actor, course) else State.AWAITING


def free_unused(robot: Robot, slot: Slot, now: datetime, but: Booking | None = None) -> None:
    """Store that unused bookings in this slot are free again, so that the constraint allows other bookings.

    A booking that nobody approved or accepted in time is cancelled.
    """
    grace = grace_of(policy_of(robot))
    in_the_way = held_between([robot], slot.starts_at, slot.ends_at).filter(used_at=None)
    for booking in in_the_way.exclude(pk=but.pk) if but else in_the_way:
        held = held_slot(booking, grace, now)
        if held.ends_at >= booking.held_until:
            continue
        _store_unused(booking, held.ends_at, now)


def store_no_shows(now: datetime, watched: timedelta = timedelta()) -> None:
    """Store that nobody used a slot whose grace time is over, and tell its person.

    `watched`: for how long the caller has seen a clock that nobody sets. Slots that began before are noted
    `NOTED_AFTER` their end. If others book sooner, `free_unused` has done it. Slots in which the robot was out of
    service are left out: their people could not drive.
    """
    long_over = Q(held_until__lte=now - NOTED_AFTER)
    found = Booking.objects.filter(
        long_over | Q(starts_at__gt=now - watched, starts_at__lte=now - LEAST_GRACE),
        state=State.BOOKED,
        used_at=None,
        starts_at__gt=now - LONGEST - NOTED_UNTIL,
        held_until__gt=now - NOTED_UNTIL,
    )
    for booking in found.filter(held_until__gt=F("starts_at")).select_related("robot"):
        grace = grace_of(policy_of(booking.robot))
        out = out_between(booking.robot, booking.starts_at, booking.starts_at + grace)
        if out or now < booking.starts_at + grace:
            continue
        with robot_locked(booking.robot_id, now) as robot:
            mine = Booking.objects.filter(pk=booking.pk, version=booking.version, used_at=None)
            for unused in mine.select_related("person", "robot"):
                _store_unused(unused, held_slot(unused, grace_of(policy_of(robot)), now).ends_at, now)


def restore_unbegun(now: datetime) -> None:
    """Give the slots back that were noted as not used although they have not begun: the clock was ahead then."""
    for booking in Booking.objects.filter(state=State.NO_SHOW, starts_at__gt=now):
        with suppress(BookingRefused), robot_locked(booking.robot_id, now):  # refused: others have booked it
            mine = Booking.objects.filter(pk=booking.pk, version=booking.version, state=State.NO_SHOW)
            for wrong in mine.select_related("person", "robot"):
                wrong.state, wrong.held_until = State.BOOKED, wrong.ends_at
                save_booking(wrong)
                record_booking("booking.restore", wrong, None)
                changed_by_another(wrong, None, lambda: _("given back"), now)


def remove_old_cancelled(now: datetime) -> None:
    """Remove bookings that were cancelled before they began: old ones, and all but a person's latest `MOST_CANCELLED`.

    The log has their records.
    """
    cancelled = Booking.objects.filter(state=State.CANCELLED, held_until=F("starts_at"))
    cancelled.filter(starts_at__lt=now - CANCELLED_KEPT).delete()
    people = cancelled.values("person").annotate(count=Count("pk")).filter(count__gt=MOST_CANCELLED)
    for person in people.values_list("person", flat=True):
        latest = cancelled.filter(person=person).order_by("-starts_at", "pk")
        older = latest.values_list("pk", flat=True)[MOST_CANCELLED : MOST_CANCELLED + REMOVED_AT_ONCE]
        Booking.objects.filter(pk__in=list(older)).delete()


def _store_unused(booking: Booking, until: datetime, now: datetime) -> None:
    """Store that nobody used a slot, or approved or accepted it in time. It is free from `until` on."""
    unused, booking.held_until = booking.state == State.BOOKED, until
    booking.state = State.NO_SHOW if unused else State.CANCELLED
    save_booking(booking)
    if unused:
        record_booking("booking.no_show", booking, None)
        changed_by_another(booking, None, lambda: _("not used, so it is free for others"), now)
    else:
        record_booking("booking.cancel", booking, None, parameters={"why": "not_approved"})


def record_booking(kind: str, booking: Booking, actor: User | SystemAccount | None, **facts: Any) -> Record:
    """Record an event of a booking. `actor` None: the console."""
    body = _body(booking, **facts)
    return record(kind, actor=actor, **named(booking.robot), **body._asdict())


def record_bookings(
    kind: str, several: Iterable[tuple[Booking, dict[str, Any]]], actor: User | SystemAccount | None
) -> None:
    """Record one event of many bookings, each with its facts, as `record_booking` does."""
    by_robot: dict[UUID, list[tuple[Booking, dict[str, Any]]]] = {}
    for booking, facts in several:
        by_robot.setdefault(booking.robot_id, []).append((booking, facts))
    for found in by_robot.values():
        bodies = [_body(booking, **facts) for booking, facts in found]
        record_all(kind, bodies, actor=actor, **named(found[0][0].robot))


def _body(
    booking: Booking,
    *,
    parameters: dict[str, Any] | None = None,
    private: dict[str, Any] | None = None,
    text: str = "",
    outcome: str = "",
) -> RecordBody:
    known: dict[str, Any] = {
        "booking": str(booking.pk),
        "person": str(booking.person_id),
        "from": booking.starts_at.isoformat(),
        "to": booking.ends_at.isoformat(),
    }
    if booking.record:
        known["record"] = True
    told = {"person_name": booking.person.display_name} | (private or {})
    if booking.purpose:
        told["purpose"] = booking.purpose
    return RecordBody(known | (parameters or {}), text, told, outcome)
