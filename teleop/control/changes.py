"""One transaction for each change of control, with its audit record; why one cannot be made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from uuid import UUID

from django.db import DatabaseError, connection, transaction

from fleet.audit.errors import AuditUnavailable, cause_of
from fleet.bookings.services import BookingRefused
from robots.registry.models import Robot
from robots.wire import NotDone, Refusal
from teleop.models import Lease


class ControlRefused(NotDone):
    """A change of control is not allowed."""


class NotStored(ControlRefused):
    """A change of control is allowed, but the database cannot store it."""


def database_refusal(error: DatabaseError) -> Refusal:
    """Return the refusal of a change that the database could not store."""
    code, cause = cause_of(error)
    return Refusal(f"database_{code}", f"Not done: {cause}. Try again.", "database")


@contextmanager
def recorded_change() -> Iterator[None]:
    """Run one transaction. Raises NotStored if the change or its audit record cannot be stored."""
    try:
        with transaction.atomic():
            yield
    except BookingRefused as error:
        raise ControlRefused(error.refusal) from error
    except AuditUnavailable as error:
        raise NotStored(Refusal(error.code, error.text, error.rule)) from error
    except DatabaseError as error:
        raise NotStored(database_refusal(error)) from error


def robot_locked(robot_id: UUID) -> Robot:
    """Return the robot, locked as bookings lock it, and its lease.

    Every change locks in this order, or two would wait for each other: robot, lease, control session or booking, log.
    A new row that refers to the robot waits for no lock (`no_key`): PostgreSQL checks it last, when the log is locked.
    """
    robot = (
        Robot.objects.select_for_update(of=("self",), no_key=True).select_related("profile").get(pk=robot_id)
    )
    if connection.features.has_select_for_update:
        Lease.objects.select_for_update(of=("self",), no_key=True).filter(robot=robot).first()
    return robot
