"""Everything that changes who has control. Each step is one transaction with its audit record.

A step that may not be done raises `ControlRefused`. Races are decided by conditional updates: who finds the lease
changed since it was read has lost, and is told so. Nothing here talks to a bridge: the caller does, after the commit.
`highest_fence` is the highest fencing number that the robot's bridge has seen, so that a database restored
from an older copy cannot hand out a number twice.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Any, TypeVar
from uuid import UUID, uuid4

from django.conf import settings
from django.db import DatabaseError, transaction
from django.db.models import QuerySet

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.errors import cause_of
from fleet.audit.models import Record
from robots.registry.models import Robot, Role
from robots.registry.selectors import role_on, supervises
from robots.registry.services import fence_next
from robots.wire import NotDone, Refusal
from teleop.control import rules
from teleop.control.policy import Permit, permitted_as
from teleop.control.rules import LeaseState, OpenRequest, Tab
from teleop.control.selectors import lease_of, open_requests_of
from teleop.models import ControlRequest, ControlSession, EndReason, Lease

T = TypeVar("T")


class ControlRefused(NotDone):
    """A step that may not be done."""


class NotStored(ControlRefused):
    """A step that may be done, and cannot be, for the database lets us down."""


def database_refusal(error: DatabaseError) -> Refusal:
    """What to say of a step that the database did not let us do."""
    code, cause = cause_of(error)
    return Refusal(f"database_{code}", f"Not done: {cause}. Try again.", "database")


@contextmanager
def recorded_change() -> Iterator[None]:
    """One transaction. What cannot be recorded, or stored, is not done."""
    try:
        with transaction.atomic():
            yield
    except audit.AuditUnavailable as error:
        raise NotStored(Refusal(error.code, error.text, error.rule)) from error
    except DatabaseError as error:
        raise NotStored(database_refusal(error)) from error


# --- taking and giving --------------------------------------------------------------------------


def lease_take(*, robot_id: UUID, user_id: UUID, tab: Tab, highest_fence: int, now: datetime) -> LeaseState:
    """Give control of a robot that nobody else has. From the same person's other tab it moves here."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        role, permit = _permit(user=user, robot=robot, now=now)
        before = lease_of(robot_id)
        _require(rules.check_take(before, user=user_id, tab=tab, now=now))
        if before is not None:
            lapsed = rules.lapse_reason(before, now)
            reason = EndReason(lapsed) if lapsed else EndReason.MOVED
            _end_session(before, reason, robot, None if lapsed else user, now)
        taken = _give(robot, user, tab, role, permit, before, highest_fence, now)
        _record("control.take", taken, robot, user)
    return taken


def lease_take_over(
    *, robot_id: UUID, user_id: UUID, tab: Tab, reason: str, highest_fence: int, now: datetime
) -> LeaseState:
    """Take control from its holder, as a supervisor or staff, for a reason that is kept."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        role, permit = _permit(user=user, robot=robot, now=now)
        held = lease_of(robot_id)
        refusal = rules.check_take_over(held, user=user_id, supervises=supervises(user, robot), now=now)
        before = _allowed(held, refusal)
        note = f"{user.display_name} took over: {reason}"
        _end_session(before, EndReason.TAKEN_OVER, robot, user, now, note=note)
        taken = _give(robot, user, tab, role, permit, before, highest_fence, now)
        _record(
            "control.take_over",
            taken,
            robot,
            user,
            parameters={"holder": str(before.user)},
            text=reason,
            private={"holder_name": before.name},
        )
    return taken


def lease_hand_over(
    *, robot_id: UUID, user_id: UUID, tab: Tab, request_id: int, highest_fence: int, now: datetime
) -> LeaseState:
    """Give control to the person behind an open request."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        held = lease_of(robot_id)
        before = _allowed(held, rules.check_holder(held, tab=tab, now=now))
        ask = _ask(robot_id, request_id, now)
        receiver = _user(ask.user)
        role, permit = _permit(user=receiver, robot=robot, now=now)
        note = f"You handed over to {receiver.display_name}."
        _end_session(before, EndReason.HANDED_OVER, robot, user, now, note=note)
        given = _give(robot, receiver, ask.tab, role, permit, before, highest_fence, now)
        _record(
            "control.hand_over",
            given,
            robot,
            user,
            parameters={"to": str(receiver.id)},
            private={"to_name": receiver.display_name},
        )
    return given


# --- keeping ------------------------------------------------------------------------------------


def lease_renew(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> None:
    """Start a fresh term."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        _, permit = _permit(user=user, robot=robot, now=now)
        held = lease_of(robot_id)
        before = _allowed(held, rules.check_renew(held, tab=tab, asks=open_requests_of(robot_id), now=now))
        ends = _term_end(permit, now)
        _change_lease(robot_id, before, {"term_ends_at": ends})
        _record("control.renew", before, robot, user, parameters={"term_s": (ends - now).total_seconds()})


def lease_resume(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> None:
    """Go on with a lease on a new connection of its tab: after a reload, a network blip, in a duplicate of the tab."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        _permit(user=user, robot=robot, now=now)
        held = lease_of(robot_id)
        before = _allowed(held, rules.check_resume(held, user=user_id, tab=tab, now=now))
        _change_lease(robot_id, before, {"connection": tab.connection, "seen_at": now})
        _record("control.resume", before, robot, user)


def lease_seen(*, robot_id: UUID, session: UUID, connection: str, seen_at: datetime) -> None:
    """Note when the holder's page was last there, if this connection still holds the lease."""
    mine = Lease.objects.filter(robot_id=robot_id, session_id=session, connection=connection)
    mine.update(seen_at=seen_at)


def lease_lost(*, robot_id: UUID, session: UUID, connection: str, now: datetime) -> None:
    """Note that the holder's page is gone; from now on it may come back for `rules.GRACE_S`."""
    mine = Lease.objects.filter(robot_id=robot_id, session_id=session, connection=connection)
    mine.update(connection="", seen_at=now)


# --- ending -------------------------------------------------------------------------------------


def lease_expire(*, robot_id: UUID, now: datetime) -> None:
    """End a lease, if its term or grace is over; refused if it has just been changed or seen."""
    with recorded_change():
        held = lease_of(robot_id)
        if held is not None and (why := rules.lapse_reason(held, now)) is not None:
            _free(robot_id, held, now, seen_at=held.seen_at)
            _end_session(held, EndReason(why), _robot(robot_id), None, now)


def lease_end(
    *,
    robot_id: UUID,
    session: UUID,
    reason: EndReason,
    refusal: Refusal | None = None,
    user_id: UUID | None = None,
    now: datetime,
) -> None:
    """End this control session, whichever connection has it by now, unless it is over.

    Its holder `user_id` gives it back; or the right to it ended, or the bridge does not take it: `refusal`.
    """
    note, why = (refusal.text, refusal.code) if refusal else ("", "")
    with recorded_change():
        held = lease_of(robot_id)
        if held is None or held.session != session:
            return
        _free(robot_id, held, now)
        by = _user(user_id) if user_id else None
        _end_session(held, reason, _robot(robot_id), by, now, note=note, why=why)


def leases_end_of_sign_in(sign_in: str, *, user_id: UUID, refusal: Refusal, now: datetime) -> None:
    """End what was taken with a sign-in that is over (its `rules.fingerprint`): no page could come back to it."""
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


# --- asking -------------------------------------------------------------------------------------


def control_request(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> int:
    """OpenRequest the holder for control. Asking again moves the question to this tab. Returns the request's number."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        _permit(user=user, robot=robot, now=now)
        held = lease_of(robot_id)
        _require(rules.check_request(held, user=user_id, now=now))
        requests_lapse(now=now)
        seat = {"tab": tab.token, "sign_in": tab.sign_in, "connection": tab.connection}
        request, _ = ControlRequest.objects.update_or_create(
            robot_id=robot_id,
            user_id=user_id,
            answered_at=None,
            defaults=seat,
            create_defaults={**seat, "asked_at": now},
        )
        _record("control.ask", held, robot, user, parameters={"request": request.pk})
    return int(request.pk)


def control_request_withdraw(*, robot_id: UUID, connection: str, gone: bool, now: datetime) -> None:
    """Withdraw the question that this connection asked, or that it left behind, if there is one."""
    outcome = ControlRequest.Outcome.GONE if gone else ControlRequest.Outcome.CANCELLED
    with recorded_change():
        _answer(now, outcome, robot_id=robot_id, connection=connection)


def requests_lapse(*, now: datetime) -> None:
    """Close the questions that nobody answered in time."""
    asked_until = now - timedelta(seconds=rules.REQUEST_S)
    with transaction.atomic():
        _answer(now, ControlRequest.Outcome.LAPSED, asked_at__lte=asked_until)


# --- stop ---------------------------------------------------------------------------------------


def clear_authorize(*, robot_id: UUID, user_id: UUID, tab: Tab | None, now: datetime) -> Record:
    """Check that this person may clear the stop latch, and record it. After this the clear may be sent."""
    with recorded_change():
        robot, user = _robot(robot_id), _user(user_id)
        held = lease_of(robot_id)
        _require(rules.check_clear(held, tab=tab, supervises=supervises(user, robot), now=now))
        return _record("stop.clear", held, robot, user)


# --- inside -------------------------------------------------------------------------------------


def _require(refusal: Refusal | None) -> None:
    if refusal is not None:
        raise ControlRefused(refusal)


def _allowed(value: T | None, refusal: Refusal | None) -> T:
    """What a rule has just allowed to use: with that it is there."""
    _require(refusal)
    if value is None:
        raise AssertionError("a rule allowed what is not there")
    return value


def _robot(robot_id: UUID) -> Robot:
    return Robot.objects.select_related("profile").get(pk=robot_id)


def _user(user_id: UUID) -> User:
    return User.objects.get(pk=user_id)


def _ask(robot_id: UUID, request_id: int, now: datetime) -> OpenRequest:
    ask = next((ask for ask in open_requests_of(robot_id) if ask.id == request_id), None)
    return _allowed(ask, rules.check_still_open(ask, now=now))


def _permit(*, user: User, robot: Robot, now: datetime) -> tuple[Role, Permit]:
    """Leave to control, and in which role."""
    role = role_on(user, robot)
    answer = permitted_as(role, user=user, robot=robot, now=now)
    if isinstance(answer, Refusal):
        raise ControlRefused(answer)
    return _allowed(role, None), answer


def _term_end(permit: Permit, now: datetime) -> datetime:
    return rules.term_end(now, settings.FLEET_CONTROL_TERM_S, permit.until)


def _give(
    robot: Robot,
    user: User,
    tab: Tab,
    role: Role,
    permit: Permit,
    before: LeaseState | None,
    highest_fence: int,
    now: datetime,
) -> LeaseState:
    """Put `user` into the lease in place of `before`, with a new control session and fencing number."""
    given = LeaseState(
        session=uuid4(),
        user=user.id,
        name=user.display_name,
        tab=tab,
        role=role,
        fence=fence_next(robot, at_least=highest_fence),
        term_ends_at=_term_end(permit, now),
        seen_at=now,
    )
    # The lease first: whoever loses a race waits here for the winner, and then finds the lease changed.
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
    ControlSession.objects.create(id=given.session, robot=robot, user=user, fence=given.fence, started_at=now)
    _answer(now, ControlRequest.Outcome.GRANTED, robot=robot, user=user)
    return given


def _free(robot_id: UUID, held: LeaseState, now: datetime, **still: Any) -> None:
    """Give the robot to nobody, if the lease's columns are `still` so. Questions for control are answered by that."""
    nobody = {
        "session": None,
        "tab": "",
        "sign_in": "",
        "connection": "",
        "role": "",
        "term_ends_at": None,
        "seen_at": None,
    }
    _change_lease(robot_id, held, nobody, **still)
    _answer(now, ControlRequest.Outcome.FREED, robot_id=robot_id)


def _answer(now: datetime, outcome: ControlRequest.Outcome, **which: Any) -> None:
    """Close the open questions for control that these filters find, each on record."""
    for request in ControlRequest.objects.filter(answered_at=None, **which).select_related("user", "robot"):
        still_open = ControlRequest.objects.filter(pk=request.pk, answered_at=None)
        if still_open.update(answered_at=now, outcome=outcome):
            asks = Record.objects.filter(robot_id=request.robot.pk, kind="control.ask", of=None)
            asked = asks.filter(parameters__request=request.pk).order_by("id").last()
            _record("control.ask", None, request.robot, None, of=asked, outcome=outcome.value)


def _change_lease(robot_id: UUID, before: LeaseState | None, to: dict[str, Any], **still: Any) -> None:
    """Change the lease if it is still as `before`, and `still` so; refused if somebody else was faster."""
    Lease.objects.get_or_create(robot_id=robot_id)
    if _unchanged(robot_id, before).filter(**still).update(**to) == 0:
        text = "Somebody else was faster: look who has control now."
        raise ControlRefused(Refusal("too_late", text, "lease"))


def _unchanged(robot_id: UUID, before: LeaseState | None) -> QuerySet[Lease]:
    """The robot's lease, if it is as it was read; that its page was seen again since changes nothing."""
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
    note: str = "",
    why: str = "",
) -> None:
    """End a control session, once, and put on record how: whoever ended it, or the console itself by its rules.

    `note` says it in words to who held it (`teleop.control.selectors.end_notes`), `why` in a word to programs.
    """
    open_ones = ControlSession.objects.filter(pk=held.session, ended_at=None)
    if not open_ones.update(ended_at=now, end_reason=reason):
        return
    parameters = {"holder": str(held.user), "why": why} if why else {"holder": str(held.user)}
    names = {"holder_name": held.name, "words": note} if note else {"holder_name": held.name}
    _record("control.end", held, robot, by, outcome=reason.value, parameters=parameters, private=names)


def _record(kind: str, held: LeaseState | None, robot: Robot, actor: User | None, **told: Any) -> Record:
    """Put on record what happens to a control session."""
    return audit.record(
        kind,
        actor=actor,
        robot_id=robot.id,
        robot_name=robot.name,
        session_id=held.session if held else None,
        fence=held.fence if held else None,
        **told,
    )
