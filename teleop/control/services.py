"""All changes of control. Each one is one transaction together with its audit record.

A change that is not allowed raises `ControlRefused`. Conditional updates decide races: if the lease changed
since it was read, the change is refused. This module sends nothing to bridges; its callers do, after the
commit. `highest_fence` is the highest fence that the robot's bridge has seen. A new fence is higher, so that
a database that was restored from an older copy cannot assign a number twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, TypeVar
from uuid import UUID, uuid4

from django.conf import settings
from django.db.models import QuerySet

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.models import Record
from fleet.base.names import fault_of
from fleet.bookings.lessons.members import shared_with
from fleet.bookings.lessons.turns import (
    control_begins,
    control_ends,
    control_handed,
    may_take_back,
    slot_used,
    turn_lengthen_running,
)
from fleet.bookings.models import Booking
from fleet.bookings.schedule import schedule_of
from fleet.bookings.services import booking_lengthen_running
from robots.access.selectors import supervises
from robots.registry.models import Robot, Role
from robots.registry.services import fence_next
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Refusal
from teleop.control import lease_checks
from teleop.control.changes import ControlRefused, recorded_change, robot_locked
from teleop.control.lease_checks import LeaseState, Tab, Waiter
from teleop.control.rules import Permit, permit_for
from teleop.control.selectors import lease_of, line_of, subject_of
from teleop.control.waiting.line import GRANTED, waiters_remove
from teleop.models import ControlSession, EndReason, Lease, named

T = TypeVar("T")

SHORTEST_REASON = 3  # letters
_NO_REASON = Refusal(
    "no_reason", "Give a reason for taking over: the person in control will read it.", "lease"
)


# --- take, take over, hand over --------------------------------------------------------------------------


def lease_take(*, robot_id: UUID, user_id: UUID, tab: Tab, highest_fence: int, now: datetime) -> LeaseState:
    """Take control of a robot that no other person controls.

    If the same person has control in another tab, control moves to this tab.
    """
    with recorded_change():
        robot, user = robot_locked(robot_id), _user(user_id)
        before = lease_of(robot_id)
        line = _line_if_free(before, robot_id, now)
        lapsed = lease_checks.lapse_reason(before, now) if before is not None else None
        if before is not None and lapsed:  # first: it ends the turn by which the same person might drive on
            _end_lapsed(before, lapsed, robot, now)
        role, permit = _permit(user=user, robot=robot, now=now, line=line)
        _require(permit.take_over_only)
        _require(lease_checks.check_take(before, user=user_id, tab=tab, now=now))
        if before is not None and not lapsed:
            _end_session(before, EndReason.MOVED, robot, user, now)
        taken = _assign(robot, user, tab, role, permit, before, highest_fence, now)
        _record("control.take", taken, robot, user)
    return taken


def lease_take_over(
    *, robot_id: UUID, user_id: UUID, tab: Tab, reason: str, highest_fence: int, now: datetime
) -> LeaseState:
    """Take control from its holder, or in another person's slot, as a supervisor or staff. The reason is recorded.

    Who owns the present slot, or leads the lesson, takes control back from its people without a reason.
    """
    if reason.strip() and (fault := fault_of(reason)):
        raise ControlRefused(Refusal(fault.code, str(fault.text), "wire"))
    with recorded_change():
        robot, user = robot_locked(robot_id), _user(user_id)
        before = lease_of(robot_id)
        line = _line_if_free(before, robot_id, now)
        free = lease_checks.is_free(before, now)
        holder = None if free or before is None else (before.user, before.role)
        back = may_take_back(robot=robot, person=user, holder=holder, now=now)
        _require(None if len(reason.strip()) >= SHORTEST_REASON or back else _NO_REASON)
        role, permit = _permit(user=user, robot=robot, now=now, line=line)
        asked = back or permit.take_over_only is not None
        if not asked or (before is not None and before.user == user_id):
            _require(
                lease_checks.check_take_over(
                    before, user=user_id, supervises=supervises(user, robot), now=now
                )
            )
        if before is not None and (lapsed := lease_checks.lapse_reason(before, now)):
            _end_lapsed(before, lapsed, robot, now)
        elif before is not None:
            note = (
                say("{name} took over: {reason}", name=user.display_name, reason=reason)
                if reason.strip()
                else say("{name} took control back.", name=user.display_name)
            )
            _end_session(before, EndReason.TAKEN_OVER, robot, user, now, note=note)
        taken = _assign(robot, user, tab, role, permit, before, highest_fence, now)
        slot = schedule_of(robot, now).current
        owner = next(
            (
                (one.user, one.name) if isinstance(one, LeaseState | Waiter) else (one.person, one.name)
                for one in (before, slot, *line)
                if one is not None
            ),
            None,
        )
        _record(
            "control.take_over",
            taken,
            robot,
            user,
            parameters={"holder": str(owner[0])} if owner else {},
            text=reason,
            private={"holder_name": owner[1]} if owner else {},
        )
    return taken


def lease_hand_over(
    *, robot_id: UUID, user_id: UUID, tab: Tab, request_id: int, highest_fence: int, now: datetime
) -> LeaseState:
    """Hand control over to a person in line."""
    with recorded_change():
        robot, user = robot_locked(robot_id), _user(user_id)
        held = lease_of(robot_id)
        before = _allowed(held, lease_checks.check_holder(held, tab=tab, now=now))
        waiter = _waiter(robot_id, request_id, now)
        receiver = _user(waiter.user)
        control_handed(robot=robot, giver=user, receiver=receiver, now=now)
        role, permit = _permit(user=receiver, robot=robot, now=now)
        note = say("You handed over to {name}.", name=receiver.display_name)
        _end_session(before, EndReason.HANDED_OVER, robot, user, now, note=note)
        given = _assign(robot, receiver, waiter.tab, role, permit, before, highest_fence, now)
        _record(
            "control.hand_over",
            given,
            robot,
            user,
            parameters={"to": str(receiver.id)},
            private={"to_name": receiver.display_name},
        )
    return given


# --- renew, resume ------------------------------------------------------------------------------------


def lease_renew(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> None:
    """Start a new term. In the holder's own slot, lengthen the slot if no other person has booked the next time."""
    with recorded_change():
        robot, user = robot_locked(robot_id), _user(user_id)
        held = lease_of(robot_id)
        _, permit = _permit(user=user, robot=robot, now=now, lease=held)
        before = _allowed(held, lease_checks.check_renew(held, tab=tab, line=line_of(robot_id, now), now=now))
        if permit.whole_slot and permit.until is not None and before.term_ends_at >= permit.until:
            if not turn_lengthen_running(robot=robot, person=user, now=now):
                booking_lengthen_running(robot=robot, person=user, now=now)
            _, permit = _permit(user=user, robot=robot, now=now)
        ends = _term_end(permit, now)
        _change_lease(robot_id, before, {"term_ends_at": ends})
        _record("control.renew", before, robot, user, parameters={"term_s": (ends - now).total_seconds()})


def lease_resume(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> None:
    """Move a lease to a new connection of its tab: after a reload or network failure, or in a duplicated tab."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        held = lease_of(robot_id)
        _permit(user=user, robot=robot, now=now, lease=held)
        before = _allowed(held, lease_checks.check_resume(held, user=user_id, tab=tab, now=now))
        _change_lease(robot_id, before, {"connection": tab.connection, "seen_at": now})
        _record("control.resume", before, robot, user)


def lease_fit_slot(*, robot_id: UUID, before: LeaseState, until: datetime, now: datetime) -> None:
    """Move the end of the term to `until`, and mark the holder's present slot, if any, as used.

    The term ends earlier if another person's slot begins, and later if the holder's own slot has begun.
    """
    with recorded_change():
        _change_lease(robot_id, before, {"term_ends_at": until})
        slot_used(robot_id=robot_id, person=_user(before.user), now=now)


def lease_store_seen(*, robot_id: UUID, session: UUID, connection: str, seen_at: datetime) -> None:
    """Store when the holder's page sent its last message, if this connection still holds the lease."""
    mine = Lease.objects.filter(robot_id=robot_id, session_id=session, connection=connection)
    mine.update(seen_at=seen_at)


def lease_page_gone(*, robot_id: UUID, session: UUID, connection: str, now: datetime) -> None:
    """Store that the holder's page is gone. It may come back within `lease_checks.GRACE_S`."""
    mine = Lease.objects.filter(robot_id=robot_id, session_id=session, connection=connection)
    mine.update(connection="", seen_at=now)


# --- end ----------------------------------------------------------------------------------------


def lease_expire(*, robot_id: UUID, now: datetime) -> None:
    """End a lease whose term or grace time is over.

    Raises ControlRefused if the lease has just changed, or if its page has sent a message again.
    """
    with recorded_change():
        held = lease_of(robot_id)
        if held is not None and (why := lease_checks.lapse_reason(held, now)) is not None:
            robot = _robot(robot_id)
            _free(robot_id, held, now, seen_at=held.seen_at)
            _end_lapsed(held, why, robot, now)


def lease_end(
    *,
    robot_id: UUID,
    session: UUID,
    reason: EndReason,
    refusal: Refusal | None = None,
    user_id: UUID | None = None,
    now: datetime,
) -> None:
    """End this control session, whichever connection has it now. Does nothing if it is over.

    `user_id` is the person who ends it (None: the console does). `refusal` is the cause, unless the holder
    releases control: the right to control ended, or the bridge refused.
    """
    note, why = (refusal.sentence, refusal.code) if refusal else (None, "")
    with recorded_change():
        held = lease_of(robot_id)
        if held is None or held.session != session:
            return
        _free(robot_id, held, now)
        by = _user(user_id) if user_id else None
        _end_session(held, reason, _robot(robot_id), by, now, note=note, why=why)


def leases_end_of_sign_in(sign_in: str, *, user_id: UUID, refusal: Refusal, now: datetime) -> None:
    """End all leases of a sign-in that is over (given by its `lease_checks.fingerprint`): no page could resume them."""
    taken = Lease.objects.filter(sign_in=sign_in).exclude(session=None)
    for robot_id, session in list(taken.values_list("robot_id", "session_id")):
        lease_end(
            robot_id=robot_id,
            session=session,
            reason=EndReason.RIGHT,
            refusal=refusal,
            user_id=user_id,
            now=now,
        )


# --- stop ---------------------------------------------------------------------------------------


def clear_authorize(*, robot_id: UUID, user_id: UUID, tab: Tab | None, now: datetime) -> Record:
    """Check and record that this person clears the stop. The caller sends the clear afterwards."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        held = lease_of(robot_id)
        _require(lease_checks.check_clear(held, tab=tab, supervises=supervises(user, robot), now=now))
        return _record("stop.clear", held, robot, user)


# --- helpers ------------------------------------------------------------------------------------


def _require(refusal: Refusal | None) -> None:
    if refusal is not None:
        raise ControlRefused(refusal)


def _allowed(value: T | None, refusal: Refusal | None) -> T:
    """Return the value that a check allowed. Raises ControlRefused if the check returned a refusal."""
    _require(refusal)
    if value is None:
        raise AssertionError("A check allowed a missing value.")
    return value


def _robot(robot_id: UUID) -> Robot:
    return Robot.objects.select_related("profile").get(pk=robot_id)


def _user(user_id: UUID) -> User:
    return User.objects.get(pk=user_id)


def _waiter(robot_id: UUID, request_id: int, now: datetime) -> Waiter:
    here = (one for one in line_of(robot_id, now) if one.tab.connection)
    waiter = next((one for one in here if one.id == request_id), None)
    return _allowed(waiter, lease_checks.check_waits(waiter))


def _permit(
    *,
    user: User,
    robot: Robot,
    now: datetime,
    line: Sequence[Waiter] = (),
    lease: LeaseState | None = None,
) -> tuple[Role, Permit]:
    """Return the person's role and permit to control. Raises ControlRefused.

    `line`: the people who wait for control, if nobody has control. `lease`: the present lease, if its holder
    keeps control.
    """
    subject = subject_of(user, robot, now, line, lease)
    answer = permit_for(subject)
    if isinstance(answer, Refusal):
        raise ControlRefused(answer)
    return _allowed(subject.role, None), answer


def _line_if_free(before: LeaseState | None, robot_id: UUID, now: datetime) -> list[Waiter]:
    return line_of(robot_id, now) if lease_checks.is_free(before, now) else []


def _term_end(permit: Permit, now: datetime) -> datetime:
    if permit.whole_slot and permit.until is not None:
        return permit.until
    return lease_checks.term_end(now, settings.FLEET_CONTROL_TERM_S, permit.until)


def _slot_note(held: LeaseState, robot: Robot, now: datetime) -> Sentence | None:
    """Return a sentence about the end of control if a slot or an out-of-service period ended it; else None."""
    schedule = schedule_of(robot, now)
    if schedule.out is not None and schedule.out.slot.starts_at == held.term_ends_at:
        return say("The robot is out of service now ({why}).", why=schedule.out.label)
    current = schedule.current
    if current is not None and current.turn is not None and current.turn.person == held.user:
        return say("Your turn is over.")
    if current is not None and current.person != held.user:
        return say("{name}’s slot began.", name=current.whose)
    ended = Booking.objects.filter(robot=robot, held_until=held.term_ends_at)
    own = ended.filter(person_id=held.user).exists() or (ended & shared_with(_user(held.user))).exists()
    return say("Your slot ended.") if own else None


def _assign(
    robot: Robot,
    user: User,
    tab: Tab,
    role: Role,
    permit: Permit,
    before: LeaseState | None,
    highest_fence: int,
    now: datetime,
) -> LeaseState:
    """Replace the lease `before` with a lease of `user` that has a new control session and fence."""
    given = LeaseState(
        session=uuid4(),
        user=user.id,
        name=named(user.display_name, tab.program),
        tab=tab,
        role=role,
        fence=fence_next(robot, at_least=highest_fence),
        term_ends_at=_term_end(permit, now),
        seen_at=now,
        started_at=now,
    )
    # Change the lease first: if two people take control at the same time, the second transaction waits here
    # for the first, and then finds that the lease has changed.
    _change_lease(
        robot.id,
        before,
        {
            "session_id": given.session,
            "tab": tab.token,
            "sign_in": tab.sign_in,
            "connection": tab.connection,
            "role": role,
            "term_ends_at": given.term_ends_at,
            "seen_at": now,
        },
    )
    ControlSession.objects.create(
        id=given.session,
        robot=robot,
        user=user,
        program=tab.program or None,
        fence=given.fence,
        started_at=now,
    )
    control_begins(robot=robot, person=user, now=now)
    waiters_remove(GRANTED, robot=robot, person=user)
    return given


def _free(robot_id: UUID, held: LeaseState, now: datetime, **still: Any) -> None:
    """Empty the lease if its columns still have the values in `still`. The hub then offers control to the line."""
    empty = {
        "session": None,
        "tab": "",
        "sign_in": "",
        "connection": "",
        "role": "",
        "term_ends_at": None,
        "seen_at": None,
    }
    _change_lease(robot_id, held, empty, **still)


def _change_lease(robot_id: UUID, before: LeaseState | None, to: dict[str, Any], **still: Any) -> None:
    """Change the lease if it still equals `before` and `still`. Raises ControlRefused if another change was faster."""
    Lease.objects.get_or_create(robot_id=robot_id)
    if _unchanged(robot_id, before).filter(**still).update(**to) == 0:
        text = "Another person was faster. Check who has control now."
        raise ControlRefused(Refusal("too_late", text, "lease"))


def _unchanged(robot_id: UUID, before: LeaseState | None) -> QuerySet[Lease]:
    """Select the robot's lease if it still equals `before`, apart from `seen_at`."""
    leases = Lease.objects.filter(robot_id=robot_id)
    if before is None:
        return leases.filter(session=None)
    return leases.filter(
        session_id=before.session, connection=before.tab.connection, term_ends_at=before.term_ends_at
    )


def _end_session(
    held: LeaseState,
    reason: EndReason,
    robot: Robot,
    by: User | None,
    now: datetime,
    *,
    note: Sentence | None = None,
    why: str = "",
) -> None:
    """End a control session that has not ended yet, and record it. `by` None: the console ended it by its rules.

    `note` is the reason in words for the holder (`teleop.control.selectors.end_notes`), `why` its code for programs.
    """
    open_ones = ControlSession.objects.filter(pk=held.session, ended_at=None)
    if not open_ones.update(ended_at=now, end_reason=reason):
        return
    if reason is not EndReason.MOVED:
        given_up = reason in (EndReason.RELEASED, EndReason.HANDED_OVER)
        control_ends(robot_id=robot.id, person_id=held.user, given_up=given_up, now=now)
    parameters = {"holder": str(held.user), "why": why} if why else {"holder": str(held.user)}
    private = {"holder_name": held.name, **({"words": note} if note else {})}
    _record("control.end", held, robot, by, outcome=reason.value, parameters=parameters, private=private)


def _end_lapsed(held: LeaseState, why: str, robot: Robot, now: datetime) -> None:
    """End a control session whose lease is over, whoever notices it first."""
    note = _slot_note(held, robot, now) if why == "term" else None
    _end_session(held, EndReason.SLOT if note else EndReason(why), robot, None, now, note=note)


def _record(kind: str, held: LeaseState | None, robot: Robot, actor: User | None, **facts: Any) -> Record:
    """Record an event of a control session."""
    return audit.record(
        kind,
        actor=actor,
        robot_id=robot.id,
        robot_name=robot.name,
        session_id=held.session if held else None,
        fence=held.fence if held else None,
        **facts,
    )
