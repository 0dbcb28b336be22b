"""The status of control of a robot: as read from the database, and as a message to one connection."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import partial
from uuid import UUID

from django.conf import settings
from msgspec import Struct

from fleet.bookings.lessons.present import InLine, Sharing
from fleet.bookings.models import Shared
from fleet.bookings.schedule import Called, Held, Schedule
from robots.registry.models import Role
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, LinkAddress, Topics
from teleop.control import lease_checks
from teleop.control.lease_checks import LeaseState, Phase, Tab, Waiter
from teleop.control.rules import Permit, schedule_for


class SessionEnd(Struct, frozen=True):
    """The end of a control session."""

    reason: str  # a models.EndReason
    note: str  # the reason in words for the holder; may be empty


class Rights(Struct, frozen=True):
    """The rights of one sign-in on one robot at this moment."""

    active: bool  # signed in, account active
    role: Role | None
    permit: Permit | wire.Refusal  # to control; or why not
    shares: frozenset[UUID] = frozenset()  # bookings of others in which the person may drive
    tasks: wire.LessonTasks | None = None  # what the present lesson leaves to the person; None: everything

    @property
    def supervises(self) -> bool:
        """Return whether this person is a supervisor of the robot or staff."""
        return self.role is not None and self.role >= Role.SUPERVISOR


class ControlStatus(Struct, frozen=True):
    """One robot's lease, the people in line for it and people's rights, read at one moment."""

    read_at: datetime
    lease: LeaseState | None
    line: list[Waiter]  # people who wait for control, the first person first
    endings: dict[UUID, SessionEnd]  # ends of the queried control sessions that are over
    rights: dict[tuple[UUID, str], Rights]  # of the queried people, by (user, session key)
    schedule: Schedule = Schedule()  # the robot's bookings
    sharing: Sharing = Sharing()  # who shares them, and the line of turns

    @property
    def turns_due(self) -> bool:
        """Return whether somebody can be called in the present lesson, or a call is over, if nobody has control."""
        current = self.schedule.current
        if current is None or current.turn_min is None or self.schedule.out is not None:
            return False
        turn = current.turn
        if turn is None:
            return bool(self.sharing.line) and not current.line_held
        return turn.ends_at is not None or turn.call_left_s(self.read_at) <= 0.0

    def moved_term_end(self) -> datetime | None:
        """Return the new end of the term if a slot changes it.

        Return None if the end does not change, or if the holder's permit is not known.

        A slot counts as used once its owner has control. If the holder's slot is not yet marked as used, this
        also returns an unchanged end: storing the end marks the slot. When another person's slot begins, a
        supervisor's control ends. To continue, the supervisor must take over with a reason.
        """
        lease = self.lease
        if lease is None:
            return None
        known = [rights for (person, _), rights in self.rights.items() if person == lease.user]
        rights = next((one for one in known if isinstance(one.permit, Permit)), None)
        if rights is None or not isinstance(permit := rights.permit, Permit):
            return None
        current = self.schedule.current
        if (
            permit.take_over_only is not None
            and current is not None
            and lease.started_at < current.holds_from
        ):
            return self.read_at
        # A holder who gave up the slot keeps control no longer than for a term of unbooked time.
        if not permit.whole_slot or permit.until is None:
            latest = lease_checks.term_end(self.read_at, settings.FLEET_CONTROL_TERM_S, permit.until)
            return latest if lease.term_ends_at > latest else None
        unused = (
            current is not None
            and not current.used
            and (current.person == lease.user or current.id in rights.shares)
        )
        return None if permit.until == lease.term_ends_at and not unused else permit.until


class RobotEntry(Struct, frozen=True):
    """One robot's entry in the registry."""

    refusal: wire.Refusal | None  # why the robot cannot be driven now; None: it can
    facts: wire.RobotFacts
    link: LinkAddress
    allowed: tuple[Allowed, ...]
    topics: Topics | None  # the robot's ROS interface; None if its entry is wrong


def control_message(status: ControlStatus, *, user: UUID, tab: Tab, rights: Rights) -> wire.Control:
    """Return the status of control as a message to the page in `tab`."""
    now, lease = status.read_at, status.lease
    phase = lease_checks.phase(lease, now)
    mine = lease is not None and lease.tab.connection == tab.connection
    free = lease is None or phase is Phase.LAPSED
    booked, next_booked = booked_slots(
        schedule_for(user, status.schedule, lease, now), user, now, rights.shares
    )
    coming = None if rights.supervises else status.schedule.out_next
    out_s = round((coming.slot.starts_at - now).total_seconds(), 1) if coming else None
    ahead = next((n for n, one in enumerate(status.line) if one.tab.connection == tab.connection), None)
    asking = None if ahead is None else status.line[ahead].id
    names = [wire.Request(one.id, one.name) for one in status.line if one.tab.connection]
    control = partial(
        wire.Control,
        asking=asking,
        ahead=ahead,
        booked=booked,
        next_booked=next_booked,
        out_s=out_s,
        lesson=_lesson(status, user, rights),
        tasks=rights.tasks,
        may_take_back=_may_take_back(status, user, rights, free=free),
    )
    if lease is None or free:
        return control(
            "free",
            requests=names if rights.supervises else [],
            offer_s=_offer_s(status, user),
            may_take_over=_take_over_only(rights) is not None,
            may_clear=rights.supervises,
            refusal=_refusal(rights) or _take_over_only(rights),
        )
    return control(
        state=_state(phase, mine=mine, own=lease.user == user),
        holder=lease.name,
        fence=lease.fence if mine else None,
        session=str(lease.session) if mine else None,
        remaining_s=round((lease.term_ends_at - now).total_seconds(), 1),
        resumable_s=round(lease_checks.resumable_s(lease, now), 1) if phase is Phase.AWAY else None,
        requests=names if mine or rights.supervises else [],
        may_take_over=lease_checks.check_take_over(lease, user=user, supervises=rights.supervises, now=now)
        is None
        and _refusal(rights) is None,
        may_clear=mine or rights.supervises,
        refusal=_refusal(rights)
        or (None if mine else lease_checks.check_take(lease, user=user, tab=tab, now=now)),
    )


def booked_slots(
    schedule: Schedule, user: UUID, now: datetime, shares: frozenset[UUID] = frozenset()
) -> tuple[wire.Booked | None, wire.Booked | None]:
    """Return the present booking with the seconds until its end, and the next one with the seconds until its start."""
    current = schedule.current
    following = next(iter(schedule.next), None)
    return (
        _booked(current, user, (current.slot.ends_at - now).total_seconds(), shares) if current else None,
        _booked(following, user, (following.slot.starts_at - now).total_seconds(), shares)
        if following
        else None,
    )


def turn_of(held: Held, line: Sequence[InLine], now: datetime) -> wire.FleetTurn | None:
    """Return whose turn it is in a lesson, and who is next; None: it has no turns, or nobody waits."""
    turn, first = held.turn, next(iter(line), None)
    if held.turn_min is None or (turn is None and first is None):
        return None
    left_s = _turn_s(turn, now)
    return wire.FleetTurn(
        turn.name if turn else None,
        turn is not None and turn.ends_at is not None,
        left_s,
        first.name if first else None,
    )


def _turn_s(turn: Called | None, now: datetime) -> float | None:
    """Return the seconds until the end of a turn; of a person who is called: to take control."""
    if turn is None:
        return None
    left_s = (turn.ends_at - now).total_seconds() if turn.ends_at else turn.call_left_s(now)
    return round(max(left_s, 0.0), 1)


def _booked(held: Held, user: UUID, seconds: float, shares: frozenset[UUID]) -> wire.Booked:
    mine = held.person == user or (held.id in shares and held.turn_min is None)
    return wire.Booked(held.whose, mine, round(seconds, 1))


def _leads(held: Held | None, user: UUID, rights: Rights) -> bool:
    """Return whether a person leads the line of a booking: its owner, and a supervisor."""
    return held is not None and (held.person == user or (held.shared != Shared.NO and rights.supervises))


def _may_take_back(status: ControlStatus, user: UUID, rights: Rights, *, free: bool) -> bool:
    """Return whether this person can take control without a reason (`lessons.turns.may_take_back` decides)."""
    current, lease = status.schedule.current, status.lease
    if current is None or not _leads(current, user, rights):
        return False
    if free or lease is None:
        return _take_over_only(rights) is not None
    return lease.user not in (user, current.person) and lease.role < Role.SUPERVISOR


def _lesson(status: ControlStatus, user: UUID, rights: Rights) -> wire.Lesson | None:
    """Return the lesson that runs now, for the people who take turns in it and who lead it."""
    current, now = status.schedule.current, status.read_at
    leads = _leads(current, user, rights)
    if current is None or current.turn_min is None or not (leads or current.id in rights.shares):
        return None
    turn, line = current.turn, status.sharing.line
    return wire.Lesson(
        booking=str(current.id),
        name=current.whose,
        leads=leads,
        held=current.line_held,
        turn=turn.name if turn else None,
        yours=turn is not None and turn.person == user,
        driving=turn is not None and turn.ends_at is not None,
        turn_s=_turn_s(turn, now),
        place=next((n for n, one in enumerate(line, 1) if one.person == user), None),
        waiting=len(line),
    )


def _offer_s(status: ControlStatus, user: UUID) -> float | None:
    """Return for how many more seconds control is offered to this person; None if it is not offered."""
    turn = lease_checks.offered(status.line, status.read_at)
    if turn is None or turn.user != user or turn.offer_until is None:
        return None
    return round((turn.offer_until - status.read_at).total_seconds(), 1)


def _take_over_only(rights: Rights) -> wire.Refusal | None:
    return rights.permit.take_over_only if isinstance(rights.permit, Permit) else None


def _state(phase: Phase, *, mine: bool, own: bool) -> wire.ControlState:
    if mine:
        return "yours"
    if phase is Phase.AWAY:
        return "away"
    return "elsewhere" if own else "other"


def _refusal(rights: Rights) -> wire.Refusal | None:
    return rights.permit if isinstance(rights.permit, wire.Refusal) else None


def change_key(control: wire.Control, status: ControlStatus) -> tuple[object, ...]:
    """Return a key that changes when `control` changes, except for the seconds that count down."""
    return (
        control.state,
        control.holder,
        control.fence,
        control.session,
        status.lease.term_ends_at if status.lease else None,
        status.schedule.current,
        next(iter(status.schedule.next), None),
        status.schedule.out_next,
        [request.number for request in control.requests],
        control.asking,
        control.ahead,
        control.offer_s is None,
        lease_checks.offered(status.line, status.read_at),
        control.may_take_over,
        control.may_take_back,
        control.lesson and (control.lesson.place, control.lesson.waiting),
        control.tasks,
        control.may_clear,
        control.refusal and control.refusal.code,
    )
