"""The line of people who wait for control of a robot: ask, leave, offer.

This module starts nothing by itself: the robot's hub detects that the robot is free, and calls `offer_next`.
`fleet.bookings.changes.waiting_list` contains the people who wait for a slot.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.models import Record
from fleet.bookings.lessons.turns import running, turn_join, turn_leave
from fleet.bookings.models import Waiting
from robots.shared.wire import Refusal
from teleop.control import lease_checks
from teleop.control.changes import ControlRefused, recorded_change, robot_locked
from teleop.control.lease_checks import Tab
from teleop.control.rules import Permit, may_wait, permit_for
from teleop.control.selectors import lease_of, line_of, subject_of

GRANTED, LEFT, GONE, LAPSED, NOT_ALLOWED = "granted", "cancelled", "gone", "lapsed", "not_allowed"


def line_join(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> int:
    """Add a person to the line, and return the waiter's id.

    A person who is in line already keeps their place, and now waits in this tab. In a lesson with turns, its people
    join the lesson's line; 0 is returned.
    """
    with recorded_change():
        robot, user = robot_locked(robot_id), User.objects.get(pk=user_id)
        held = lease_of(robot_id)
        line_tidy(robot_id=robot_id, now=now)
        subject = subject_of(user, robot, now, line_of(robot_id, now))
        if (refusal := may_wait(subject)) is not None:
            raise ControlRefused(refusal)
        current = subject.schedule.current
        if current is not None and current.turn_min is not None and current.id in subject.shares:
            turn_join(booking_id=current.id, person=user, now=now)
            return 0
        if lease_checks.is_free(held, now):
            answer = permit_for(subject)
            refusal = _FREE if isinstance(answer, Permit) and answer.take_over_only is None else None
        else:
            refusal = lease_checks.check_other_holds(held, user=user_id, now=now)
        if refusal is not None:
            raise ControlRefused(refusal)
        fields = {"tab": tab.token, "sign_in": tab.sign_in, "connection": tab.connection, "seen_at": now}
        waiter, _ = Waiting.objects.update_or_create(
            robot=robot,
            person=user,
            starts_at=None,
            defaults=fields,
            create_defaults={**fields, "since": now},
        )
        audit.record(
            "control.ask",
            actor=user,
            robot_id=robot.id,
            robot_name=robot.name,
            session_id=held.session if held else None,
            fence=held.fence if held else None,
            parameters={"request": waiter.pk},
        )
    return int(waiter.pk)


def line_leave(*, robot_id: UUID, user_id: UUID, connection: str, now: datetime) -> None:
    """Remove this connection's waiter, if it has one. In a lesson with turns, the person leaves its line."""
    with recorded_change():
        waiters_remove(LEFT, robot_id=robot_id, connection=connection)
        lesson = running(robot_id, now)
        if lesson is not None and lesson.turn_min is not None:
            turn_leave(booking_id=lesson.pk, person=User.objects.get(pk=user_id), now=now)


def line_away(*, robot_id: UUID, connection: str) -> None:
    """Store that this waiter's page is gone.

    The waiter stays in line for `lease_checks.WAITS_S`, so that a person can reload the page.
    """
    Waiting.objects.filter(robot_id=robot_id, starts_at=None, connection=connection).update(connection="")


def line_resume(*, robot_id: UUID, user_id: UUID, tab: Tab, now: datetime) -> bool:
    """Store the new connection of a waiter's tab. Return False if nobody waits in this tab."""
    mine = Waiting.objects.filter(
        robot_id=robot_id, person=user_id, starts_at=None, tab=tab.token, sign_in=tab.sign_in
    )
    return mine.update(connection=tab.connection, seen_at=now) == 1


def line_keep(*, robot_id: UUID, connections: list[str], now: datetime) -> None:
    """Store that these waiters' pages are open now.

    If a web process dies, its waiters leave the line after `lease_checks.WAITS_S`.
    """
    Waiting.objects.filter(robot_id=robot_id, starts_at=None, connection__in=connections).update(seen_at=now)


def line_tidy(*, now: datetime, robot_id: UUID | None = None) -> None:
    """Remove waiters whose pages are gone, and waiters who did not use their offer."""
    which: dict[str, Any] = {"robot_id": robot_id} if robot_id else {}
    with recorded_change():
        waiters_remove(GONE, seen_at__lte=now - timedelta(seconds=lease_checks.WAITS_S), **which)
        waiters_remove(LAPSED, offer_until__lte=now, **which)
        # An offer that ends later than this was made before the clock was set back.
        set_back = now + timedelta(seconds=lease_checks.OFFER_S)
        waiters_remove(LAPSED, offer_until__gt=set_back, **which)


def offer_next(*, robot_id: UUID, now: datetime) -> bool:
    """Offer control of a free robot to the first person in line who may take it.

    Return False if there is no new offer: the robot is not free, an offer is running, or nobody in line may
    take control.
    """
    with recorded_change():
        robot = robot_locked(robot_id)
        line_tidy(robot_id=robot_id, now=now)
        line = line_of(robot_id, now)
        if not lease_checks.is_free(lease_of(robot_id), now) or lease_checks.offered(line, now) is not None:
            return False
        people = User.objects.in_bulk([one.user for one in line])
        for waiter in line:
            if not waiter.tab.connection:  # the page may come back, so the waiter stays in line
                continue
            subject = subject_of(people[waiter.user], robot, now)
            if may_wait(subject) is not None:  # the right to control has ended
                waiters_remove(NOT_ALLOWED, pk=waiter.id)
                continue
            answer = permit_for(subject)
            if isinstance(answer, Permit) and answer.take_over_only is None:
                Waiting.objects.filter(pk=waiter.id).update(
                    offer_until=now + timedelta(seconds=lease_checks.OFFER_S)
                )
                audit.record(
                    "control.offer",
                    robot_id=robot.id,
                    robot_name=robot.name,
                    parameters={
                        "to": str(waiter.user),
                        "request": waiter.id,
                        "seconds": lease_checks.OFFER_S,
                    },
                    private={"to_name": waiter.name},
                )
                return True
    return False


def waiters_remove(outcome: str, **which: Any) -> None:
    """Remove the waiters in line that match these filters, and record the outcome."""
    for waiter in Waiting.objects.filter(starts_at=None, **which).select_related("robot"):
        if Waiting.objects.filter(pk=waiter.pk).delete()[0]:
            asks = Record.objects.filter(robot_id=waiter.robot.pk, kind="control.ask", of=None)
            asked = asks.filter(parameters__request=waiter.pk).order_by("id").last()
            audit.record(
                "control.ask",
                robot_id=waiter.robot.id,
                robot_name=waiter.robot.name,
                of=asked,
                outcome=outcome,
            )


_FREE = Refusal("free", "The robot is free: take control.", "lease")
