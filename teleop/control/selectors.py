"""Queries about control. They return the values that the rules work on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from django.db.models.functions import Lower

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in
from fleet.audit.models import Record
from fleet.base.database import rows
from fleet.bookings.lessons.present import Sharing, sharing_of
from fleet.bookings.schedule import Schedule, schedule_of
from robots.access.models import Qualification
from robots.access.selectors import lacking, missing_qualifications, role_on, roles_on
from robots.registry.known_robots import known_robot
from robots.registry.models import Robot, Role
from robots.registry.selectors import link_address
from robots.shared.sentences import Sentence, of_parts
from robots.shared.wire import Refusal
from teleop.control.lease_checks import WAITS_S, LeaseState, Tab, Waiter, is_free
from teleop.control.rules import Subject, bound_by, out_of_service, permit_for, schedule_for
from teleop.control.status import ControlStatus, Rights, RobotEntry, SessionEnd
from teleop.models import ControlSession, named

SignIn = tuple[UUID, str]  # user, session key

SIGNED_OUT = Refusal("signed_out", "You are signed out: sign in again.", "account")


_LEASES = """
SELECT l.robot_id, s.id, s.user_id, COALESCE(NULLIF(u.full_name, ''), u.username), s.program, l.tab, l.sign_in,
    l.connection, l.role, s.fence, l.term_ends_at, l.seen_at, s.started_at
FROM teleop_lease l JOIN teleop_controlsession s ON s.id = l.session_id JOIN accounts_user u ON u.id = s.user_id
"""
_LINE = """
SELECT w.id, w.person_id, COALESCE(NULLIF(u.full_name, ''), u.username), w.tab, w.sign_in, w.connection, w.offer_until
FROM bookings_waiting w JOIN accounts_user u ON u.id = w.person_id
WHERE w.robot_id = %s AND w.starts_at IS NULL AND w.seen_at > %s AND w.seen_at < %s
ORDER BY w.since, w.id
"""


def lease_of(robot_id: UUID) -> LeaseState | None:
    """Return the robot's lease as stored. Its time may be over already (`lease_checks.phase`)."""
    return next(
        (_lease_state(*row) for _, *row in rows.read(_LEASES + "WHERE l.robot_id = %s", [robot_id])), None
    )


def held_leases() -> list[tuple[UUID, LeaseState]]:
    """Return every robot with a lease, and the lease."""
    return [(rows.key(robot), _lease_state(*row)) for robot, *row in rows.read(_LEASES, [])]


def line_of(robot_id: UUID, now: datetime) -> list[Waiter]:
    """Return the people in line for control, the first person first. Their pages were open in the last `WAITS_S`."""
    lately = timedelta(seconds=WAITS_S)
    return [
        Waiter(key, rows.key(user), name, Tab(*tab), offer_until and rows.moment(offer_until))
        for key, user, name, *tab, offer_until in rows.read(_LINE, [robot_id, now - lately, now + lately])
    ]


def control_status(
    robot_id: UUID, *, people: Collection[SignIn], sessions: Collection[UUID], now: datetime
) -> ControlStatus:
    """Read the robot's lease and its line, the rights of `people`, and the ends of `sessions`."""
    known = known_robot(robot_id)
    robot = known.robot if known else None
    lease = lease_of(robot_id)
    schedule = schedule_of(robot, now) if robot else Schedule()
    line = line_of(robot_id, now)
    sharing = sharing_of(schedule, {user for user, _key in people})
    return ControlStatus(
        read_at=now,
        lease=lease,
        line=line,
        endings=_endings(set(sessions) - {lease.session} if lease else sessions),
        rights=rights_of(people, robot, now, schedule, line if is_free(lease, now) else (), lease, sharing),
        schedule=schedule,
        sharing=sharing,
    )


def subject_of(
    user: User, robot: Robot, now: datetime, line: Sequence[Waiter] = (), lease: LeaseState | None = None
) -> Subject:
    """Return the facts by which the rules judge whether a person may take control, or the holder may keep it."""
    missing = tuple(missing_qualifications(user, robot, now))
    schedule = schedule_for(user.pk, schedule_of(robot, now), lease, now)
    sharing = sharing_of(schedule, [user.pk])
    return Subject(
        user,
        robot,
        role_on(user, robot),
        schedule,
        now,
        missing,
        tuple(line),
        sharing.of(user.pk),
        sharing.line,
        holds=lease is not None and lease.user == user.pk,
    )


def end_notes(sessions: Collection[UUID]) -> dict[UUID, Sentence]:
    """Return the recorded sentence about the end of each of these control sessions, if there is one.

    These sentences are stored only in the audit log. They contain reasons and names, so they expire, and are
    deleted when a person is erased.
    """
    # Lower() makes SQLite use the index of sessions. By the index of kinds it would read all sessions' ends.
    of_sessions = Record.objects.filter(session_id__in=sessions).alias(what=Lower("kind"))
    ends = of_sessions.filter(what="control.end", content__isnull=False)
    found = ends.values_list("session_id", "content__data")
    return {
        session: of_parts(data["words"], data.get("said", [data["words"]]))
        for session, data in found
        if session and "words" in data
    }


def rights_of(
    people: Collection[SignIn],
    robot: Robot | None,
    now: datetime,
    schedule: Schedule | None = None,
    line: Sequence[Waiter] = (),
    lease: LeaseState | None = None,
    sharing: Sharing | None = None,
) -> dict[SignIn, Rights]:
    """Return each sign-in's rights on the robot; no rights if the robot is None (it was deleted).

    This takes three queries for any number of people, one more if a sign-in ended or the robot demands a
    qualification, and one more (`schedule_of`) if no `schedule` is given. A slot that runs takes one more, a lesson
    three, if no `sharing` is given.
    """
    active = signed_in(people)
    users = {user.id: user for user in active.values()}
    if ended := {user_id for user_id, _ in people} - users.keys():
        users |= User.objects.in_bulk(ended)
    roles = roles_on(robot.id, users.values()) if robot else {}
    missing = lacking(robot, users.values(), now) if robot else {}
    schedule = schedule or (schedule_of(robot, now) if robot else Schedule())
    sharing = sharing or sharing_of(schedule, users)
    held_by = None if lease is None or is_free(lease, now) else lease.user
    return {
        (user_id, key): _rights(
            users.get(user_id),
            (user_id, key) in active,
            roles.get(user_id),
            robot,
            schedule_for(user_id, schedule, lease, now),
            now,
            missing.get(user_id, ()),
            line,
            sharing,
            holds=held_by == user_id,
        )
        for user_id, key in set(people)
    }


def who_sees(people: Collection[SignIn], robot_id: UUID) -> set[SignIn]:
    """Return which of these sign-ins may see the robot now. Cheaper than `rights_of`: it reads no bookings."""
    active = signed_in(people)
    there = rows.read("SELECT 1 FROM robots_robot WHERE id = %s", [robot_id])
    roles = roles_on(robot_id, active.values()) if there else {}
    return {person for person, user in active.items() if user.id in roles}


def _rights(
    user: User | None,
    active: bool,
    role: Role | None,
    robot: Robot | None,
    schedule: Schedule,
    now: datetime,
    missing: Sequence[Qualification],
    line: Sequence[Waiter],
    sharing: Sharing,
    *,
    holds: bool,
) -> Rights:
    if user is None or not user.is_active:
        return _no_rights(Refusal("account_inactive", "This account is closed; ask the staff.", "account"))
    if not active:
        return _no_rights(SIGNED_OUT)
    if robot is None or role is None:
        return Rights(True, None, Refusal("no_role", "You have no role on this robot.", "account"))
    shares = sharing.of(user.pk)
    subject = Subject(
        user, robot, role, schedule, now, tuple(missing), tuple(line), shares, sharing.line, holds=holds
    )
    return Rights(True, role, permit_for(subject), shares, bound_by(subject))


def robot_entry(robot_id: UUID) -> RobotEntry | None:
    """Return the facts about the robot that pages and the link need; None if it was deleted."""
    known = known_robot(robot_id)
    if known is None:
        return None
    out, address = out_of_service(known.robot), link_address(known.robot)
    return RobotEntry(out, known.facts, address, known.allowed, known.topics)


def _no_rights(refusal: Refusal) -> Rights:
    return Rights(active=False, role=None, permit=refusal)


def _endings(sessions: Collection[UUID]) -> dict[UUID, SessionEnd]:
    if not sessions:
        return {}
    over = ControlSession.objects.filter(pk__in=sessions, ended_at__isnull=False)
    notes = end_notes(sessions)
    return {session.id: SessionEnd(session.end_reason, notes.get(session.id, "")) for session in over}


def _lease_state(
    session: Any,
    user: Any,
    name: str,
    program: str | None,
    tab: str,
    sign_in: str,
    connection: str,
    role: str,
    fence: int,
    term_ends_at: Any,
    seen_at: Any,
    started_at: Any,
) -> LeaseState:
    return LeaseState(
        session=rows.key(session),
        user=rows.key(user),
        name=named(name, program),
        tab=Tab(tab, sign_in, connection),
        role=Role(role),
        fence=fence,
        term_ends_at=rows.moment(term_ends_at),
        seen_at=rows.moment(seen_at),
        started_at=rows.moment(started_at),
    )
