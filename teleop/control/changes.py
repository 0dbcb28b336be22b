"""One transaction for each change of control and its audit record; errors of changes that cannot be made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from uuid import UUID

from django.db import DatabaseError, connection, transaction

from fleet.audit.errors import AuditUnavailable, cause_of
from fleet.bookings.services import BookingRefused
from robots.registry.models import Robot
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.models import Lease


class ControlRefused(NotDone):
    """A change of control is not allowed."""


class NotStored(ControlRefused):
    """A change of control is allowed, but the database cannot store it."""


def database_refusal(error: DatabaseError) -> Refusal:
    """Return the refusal of a change that the database could not store."""
    code, cause = cause_of(error)
    return Refusal(f"database_{code}", say("Not done: {cause}. Try again.", cause=cause), "database")


@contextmanager
def recorded_change() -> Iterator[None]:
    """Run one transaction. Raises NotStored if the change or its audit record cannot be stored."""
    try:
        with transaction.atomic():
            yield
    except BookingRefused as error:
        raise ControlRefused(error.refusal) from error
    except AuditUnavailable as error:
        raise NotStored(Refusal(error.code, error.text, error.rule, getattr(error, "figures", {}))) from error
    except DatabaseError as error:
        raise NotStored(database_refusal(error)) from error


def robot_locked(robot_id: UUID) -> Robot:
    """Lock the row of the robot, as bookings do, and the row of its lease. Return the robot.

    Every change locks in this order: robot, lease, control session or booking, log. Else two changes could
    wait for each other. The lock does not block new rows that refer to the robot (`no_key`): PostgreSQL
    checks such a reference at the end of its transaction, when that transaction has already locked the log.
    """
    robot = (
        Robot.objects.select_for_update(of=("self",), no_key=True).select_related("profile").get(pk=robot_id)
    )
    if connection.features.has_select_for_update:
        Lease.objects.select_for_update(of=("self",), no_key=True).filter(robot=robot).first()
    return robot
