"""The rules of control: whether a person may control a robot now, and until when."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from uuid import UUID

from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.base.zones import zone_of
from fleet.bookings.lessons.present import InLine
from fleet.bookings.models import Shared
from fleet.bookings.rules import FAR, Slot
from fleet.bookings.schedule import Held, Schedule
from robots.access.models import Qualification
from robots.registry.models import Robot, Role
from robots.shared.sentences import Sentence, say
from robots.shared.wire import LessonTasks, Refusal
from teleop.control.lease_checks import OFFER_S, LeaseState, Waiter, offered

ROLE_LOWERED = Refusal("role_lowered", "Your role on this robot is lower now. Take control again.", "account")
ROBOT_DISABLED = Refusal("robot_disabled", "This robot is out of service: staff switched it off.", "robot")


# If a slot is booked after another person took control, control ends at the earliest after this time, or
# after half of a short slot (`schedule_for`).
WARNING = timedelta(minutes=5)


def schedule_for(user: UUID, schedule: Schedule, lease: LeaseState | None, now: datetime) -> Schedule:
    """Return the schedule that applies to a person.

    If another person booked a slot after the holder took control, the slot begins for the holder at the
    earliest `WARNING` after the booking. For a slot shorter than twice `WARNING`, half of the slot replaces
    `WARNING`, so that the slot's owner gets control, too.
    """
    if lease is None or lease.user != user:
        return schedule
    slots = [_after_warning(held, lease) for held in (schedule.current, *schedule.next) if held is not None]
    slots = [held for held in slots if held.slot.ends_at > held.slot.starts_at]
    return structs.replace(
        schedule,
        current=next((held for held in slots if held.slot.starts_at <= now), None),
        next=tuple(held for held in slots if held.slot.starts_at > now),
    )


def _after_warning(held: Held, lease: LeaseState) -> Held:
    if held.person == lease.user or lease.started_at >= held.booked_at:
        return held
    ends = held.slot.ends_at if held.lapses_at is None else min(held.slot.ends_at, held.lapses_at)
    warned = min(WARNING, (ends - held.holds_from) / 2)
    begins = max(held.slot.starts_at, held.booked_at + warned)
    return structs.replace(held, slot=Slot(begins, max(begins, held.slot.ends_at)))


def out_of_service(robot: Robot) -> Refusal | None:
    """Return why nobody can drive the robot; None if it can be driven."""
    if not robot.enabled:
        return ROBOT_DISABLED
    if robot.problems:
        text = say(
            "This robot cannot be driven: its entry in the registry is wrong: {problems}. Tell the staff.",
            problems=robot.problems,
        )
        return Refusal("robot_misdescribed", text, "robot")
    return None


def out_now(robot: Robot, schedule: Schedule, user: User, now: datetime) -> Refusal | None:
    """Return why the robot is out of service for all but its supervisors; None: it is in service."""
    if not robot.enabled:
        return ROBOT_DISABLED
    if (out := schedule.out) is None:
        return None
    key = "This robot is out of service {until} ({why}). Choose another robot."
    text = say(key, until=_until(out.slot.ends_at, user, now), why=out.label)
    return Refusal("out_of_service", text, "robot")


class Permit(Struct, frozen=True):
    """Permission to control. `until` None: this rule sets no end."""

    until: datetime | None = None
    max_share: float = 1.0  # share of the robot's speed limits
    whole_slot: bool = False  # a term lasts until `until`, without renewals
    # Set if the person may only take over, with a reason: another person has booked, or is next in line.
    take_over_only: Refusal | None = None

    def narrowed_by(self, other: Permit) -> Permit:
        """Return a permit with the limits of both: the earlier end, the lower share."""
        ends = [until for until in (self.until, other.until) if until is not None]
        return Permit(
            until=min(ends, default=None),
            max_share=min(self.max_share, other.max_share),
            whole_slot=self.whole_slot or other.whole_slot,
            take_over_only=self.take_over_only or other.take_over_only,
        )


class Subject(Struct, frozen=True):
    """The facts by which the rules judge a person who wants a robot."""

    user: User
    robot: Robot
    role: Role | None
    schedule: Schedule
    now: datetime
    missing: tuple[Qualification, ...] = ()  # the robot demands them, and the person does not hold them
    line: tuple[Waiter, ...] = ()  # people who wait for control, if nobody has control
    shares: frozenset[UUID] = frozenset()  # bookings of others in which the person may drive
    turns: tuple[InLine, ...] = ()  # people who wait for a turn in the present lesson
    holds: bool = False  # the person has control now

    @property
    def supervises(self) -> bool:
        """Return whether the person is a supervisor of the robot or staff."""
        return self.role is not None and self.role >= Role.SUPERVISOR


Rule = Callable[[Subject], Permit | Refusal]  # one condition of control


def require_active_account(subject: Subject) -> Permit | Refusal:
    """Refuse closed accounts."""
    if subject.user.is_active:
        return Permit()
    return Refusal("account_inactive", "This account is closed; ask the staff.", "account")


def require_robot_in_service(subject: Subject) -> Permit | Refusal:
    """Refuse robots that are out of service, and limit the speed to the robot's own share.

    Supervisors may drive in an out-of-service period, to repair the robot. Control of other people ends when
    such a period begins.
    """
    if (refusal := out_of_service(subject.robot)) is not None:
        return refusal
    out = None if subject.supervises else out_now(subject.robot, subject.schedule, subject.user, subject.now)
    coming = None if subject.supervises else subject.schedule.out_next
    return out or Permit(until=coming.slot.starts_at if coming else None, max_share=subject.robot.max_share)


def require_role(subject: Subject) -> Permit | Refusal:
    """Require the role operator or higher on this robot."""
    if subject.role is not None and subject.role >= Role.OPERATOR:
        return Permit()
    return Refusal(
        "role_too_low",
        say(
            "You may watch {name} but not drive it. Ask the staff for the role operator.",
            name=subject.robot.name,
        ),
        "account",
    )


def require_qualification(subject: Subject) -> Permit | Refusal:
    """Require each qualification that the robot demands."""
    if not subject.missing:
        return Permit()
    names = ", ".join(one.name for one in subject.missing)
    where = " ".join(one.description for one in subject.missing if one.description)
    text = say(
        "You may not drive {robot}: it demands {names}, which you do not hold or which has expired. {help}",
        robot=subject.robot.name,
        names=names,
        help=where or say("Ask the staff or your course’s supervisor."),
    )
    return Refusal("unqualified", text, "account", {"missing": names})


def bound_by(subject: Subject) -> LessonTasks | None:
    """Return what the present lesson leaves to this person; None: everything.

    It binds its members, but neither its teacher nor supervisors of the robot.
    """
    current = subject.schedule.current
    bound = current is not None and current.id in subject.shares and not subject.supervises
    return current.tasks if current is not None and bound else None


def within_lesson(subject: Subject) -> Permit | Refusal:
    """Limit the speed of a lesson's members to that of the lesson; refuse those who only watch in it."""
    tasks, current = bound_by(subject), subject.schedule.current
    if tasks is None or current is None:
        return Permit()
    if tasks.watch:
        text = say("In this lesson of {name} you watch: the teacher drives.", name=current.whose)
        return Refusal("only_watching", text, "booking")
    return Permit(max_share=tasks.max_share)


def require_booking(subject: Subject) -> Permit | Refusal:
    """In a slot, permit its owner and who shares it. In unbooked time, permit everybody until the next slot of others.

    A booking policy can restrict unbooked time to supervisors and staff. A supervisor may take over in
    another person's slot.
    """
    schedule, me = subject.schedule, subject.user.id
    begins = next((held.slot.starts_at for held in schedule.next if not _joins(subject, held)), None)
    current = schedule.current
    if current is not None and current.person == me:
        return Permit(until=_own_end(current, schedule), whole_slot=True)
    if current is not None:
        answer = _shared(subject, current) if current.id in subject.shares else _booked(subject, current)
        if isinstance(answer, Refusal) and subject.supervises:
            return Permit(until=begins, take_over_only=answer)
        return answer
    if schedule.free_time or subject.supervises:
        return Permit(until=begins)
    return Refusal("book_first", "This robot is for booked time only: book a slot first.", "booking")


def _joins(subject: Subject, held: Held) -> bool:
    """Return whether a person may go on driving when this slot begins: it is theirs, or their team's."""
    mine = held.person == subject.user.id
    return mine or (held.shared == Shared.PEOPLE and held.turn_min is None and held.id in subject.shares)


def _booked(subject: Subject, current: Held) -> Refusal:
    """Return the refusal for a person who has nothing to do with the present slot."""
    until = current.slot.ends_at
    key = (
        "{holder} has a lesson on this robot {until}. Book another time."
        if current.course
        else "{holder} has booked this robot {until}. Book another time, or ask for control."
    )
    text = say(key, holder=current.whose, until=_until(until, subject.user, subject.now))
    return Refusal("booked", text, "booking", {"holder": current.whose, "until": until.isoformat()})


def _shared(subject: Subject, current: Held) -> Permit | Refusal:
    """Permit a person who shares the present slot; with turns, only in their turn."""
    me, now, ends = subject.user.id, subject.now, current.slot.ends_at
    if current.turn_min is None:
        return Permit(until=ends, whole_slot=current.shared != Shared.COURSE)
    turn, first = current.turn, next(iter(subject.turns), None)
    if turn is not None and turn.person == me:
        return Permit(until=min(turn.until(now), ends), whole_slot=True)
    may_begin = turn is None and not current.line_held and not subject.holds
    if may_begin and (first is None or first.person == me):
        return Permit(until=min(now + _lasts(first, current.turn_min), ends), whole_slot=True)
    return _not_your_turn(subject, current, current.turn_min)


def _lasts(one: InLine | None, turn_min: int) -> timedelta:
    return timedelta(minutes=turn_min) if one is None or one.left_s is None else timedelta(seconds=one.left_s)


def _not_your_turn(subject: Subject, current: Held, turn_min: int) -> Refusal:
    """Return who drives, and the person's place and about when it is their turn."""
    turn, now = current.turn, subject.now
    place = next((n for n, one in enumerate(subject.turns, 1) if one.person == subject.user.id), None)
    if place is None:
        yours = say("Join the line to drive.")
        minutes = None
    else:
        wait = (turn.until(now) - now) if turn else timedelta(0)
        wait = sum((_lasts(one, turn_min) for one in subject.turns[: place - 1]), start=wait)
        minutes = max(0, round(wait / timedelta(minutes=1)))
        yours = say("You are number {place} in line, in about {minutes} min.", place=place, minutes=minutes)
    if current.line_held:
        text = say("{name} holds the line. {yours}", name=current.name, yours=yours)
    elif name := turn.name if turn else next((one.name for one in subject.turns), ""):
        text = say("It is the turn of {name}. {yours}", name=name, yours=yours)
    else:
        text = say("Your turn is over. {yours}", yours=yours)
    figures = {"driver": turn.name if turn else None, "place": place, "minutes": minutes}
    return Refusal("not_your_turn", text, "booking", figures)


def require_turn(subject: Subject) -> Permit | Refusal:
    """While nobody has control, permit the next person in line, and the owner of the present slot.

    A supervisor may take over, with a reason. In a lesson with turns, the lesson's own line decides.
    """
    current, me, now = subject.schedule.current, subject.user.id, subject.now
    if not subject.line or (current is not None and (current.person == me or current.turn_min is not None)):
        return Permit()
    turn = offered(subject.line, now)
    first = turn or subject.line[0]
    if first.user == me:
        return Permit()
    left_s = (turn.offer_until - now).total_seconds() if turn and turn.offer_until else OFFER_S
    text = say(
        "{next} is next in line and has {seconds:.0f} s to take control.", next=first.name, seconds=left_s
    )
    if all(one.user != me for one in subject.line):
        text = say("{turn} Ask for control to wait in line.", turn=text)
    refusal = Refusal("next_in_line", text, "lease", {"next": first.name, "seconds": round(left_s, 1)})
    return Permit(take_over_only=refusal) if subject.supervises else refusal


def _own_end(current: Held, schedule: Schedule) -> datetime:
    """Return the end of the person's present slot, or of the last of their slots that follow without a gap."""
    end = current.slot.ends_at
    for held in schedule.next:
        if held.person != current.person or held.slot.starts_at > end:
            break
        end = held.slot.ends_at
    return end


def _until(moment: datetime, user: User, now: datetime) -> Sentence:
    """Return "until 15:00" in the person's time zone; with the date if it is not today."""
    if moment == FAR:
        return say("until further notice")
    zone = zone_of(user.time_zone)
    local = moment.astimezone(zone)
    if local.date() == now.astimezone(zone).date():
        return say("until {time:clock}", time=local)
    return say("until {time:when}", time=local)


RULES: tuple[Rule, ...] = (
    require_active_account,
    require_robot_in_service,
    require_role,
    require_qualification,
    within_lesson,
    require_booking,
    require_turn,
)


def may_wait(subject: Subject) -> Refusal | None:
    """Return why a person may not wait for control. Another person's booking or turn is no reason."""
    answer = permit_for(structs.replace(subject, schedule=Schedule(out=subject.schedule.out), line=()))
    return answer if isinstance(answer, Refusal) else None


def permit_for(subject: Subject) -> Permit | Refusal:
    """Return the permit that all rules agree on, or the first refusal."""
    permit = Permit()
    for rule in RULES:
        answer = rule(subject)
        if isinstance(answer, Refusal):
            return answer
        permit = permit.narrowed_by(answer)
    return permit
