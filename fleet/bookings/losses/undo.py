"""Undo a change within a day, and give back the bookings of a course that is opened again.

Only what is still free comes back: meanwhile others may have booked it, or the person may have lost the right in
another way.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models import Q, QuerySet
from django.dispatch import receiver
from msgspec import Struct, convert

from fleet.accounts.models import Erasure, User
from fleet.audit.services import record
from fleet.bookings.losses import letters
from fleet.bookings.losses.collecting import FIELDS, Actor, How, collected
from fleet.bookings.losses.lost_rights import may_still_be_used
from fleet.bookings.losses.rows import Row, may_change, put_back
from fleet.bookings.models import Booking, Change
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import (
    OPEN,
    Stage,
    grace_of,
    held_between,
    held_slot,
    policy_of,
    stage_of,
)
from fleet.bookings.services import BookingRefused, free_unused, record_booking, robot_locked, save_booking
from robots.access.models import Course
from robots.access.signals import course_opened, publish_access_changed
from robots.registry.models import Robot
from robots.shared.wire import NotDone, Refusal

UNDO_FOR = timedelta(days=1)

_UNDONE = Refusal("undone", "This change is undone already.", "booking")
_TOO_LATE = Refusal(
    "too_late_to_undo", "A change can be undone for a day. Change it back on its own page.", "booking"
)
_FOR_GOOD = Refusal("for_good", "A person who was erased stays erased.", "booking")
_RIGHT_LOST = Refusal(
    "permission_denied", "You may not change these entries any more: ask the staff to undo it.", "account"
)


class UndoRefused(NotDone):
    """A change cannot be undone."""


class Undone(Struct):
    """The bookings that came back and that stay lost, and how many entries somebody changed since."""

    back: list[Booking]
    lost: list[Booking]
    entries: int = 0


def changes_of(person: User) -> QuerySet[Change]:
    """Return the changes that this person may undo: their own, and for staff all."""
    found = Change.objects.select_related("actor", "undone_by")
    return found if person.is_staff else found.filter(actor=person)


def undo_refused(change: Change, now: datetime, actor: User) -> Refusal | None:
    """Return why this person cannot undo a change; None: they can.

    It takes the right to change the entries now, not only when the change was made.
    """
    if change.undone_at is not None:
        return _UNDONE
    if not change.rows or _erased(change):
        return _FOR_GOOD
    if now - change.made_at > UNDO_FOR:
        return _TOO_LATE
    return None if may_change(actor, convert(change.rows, list[Row])) else _RIGHT_LOST


def _erased(change: Change) -> bool:
    """Return whether a person whose account the change closed is erased, or about to be."""
    closed = [row["key"] for row in change.rows if row["table"] == User._meta.label]
    gone = Q(username__startswith="erased-") | Q(pk__in=Erasure.objects.values("person"))
    return bool(closed) and User.objects.filter(gone, pk__in=closed).exists()


@transaction.atomic
def undo(*, change_id: UUID, actor: User, now: datetime) -> Undone:
    """Undo a change: entries, then the bookings that are still free. Raises `UndoRefused`."""
    list(Robot.objects.select_for_update(no_key=True).order_by("pk").values_list("pk"))
    change = Change.objects.select_for_update(of=("self",)).get(pk=change_id)
    if (refusal := undo_refused(change, now, actor)) is not None:
        raise UndoRefused(refusal)
    entries = put_back(convert(change.rows, list[Row]))
    done = _give_back(change, actor, now)
    done.entries = entries
    publish_access_changed(None)
    return done


@receiver(course_opened)
def _course_opened(*, course: Course, **_options: Any) -> None:
    """Give the bookings of a course back that its archiving took."""
    found = collected()
    change = Change.objects.filter(archived=course, undone_at=None).first()
    if change is None or found is None:
        return
    done = _give_back(change, found.actor, found.now)
    found.came_back += done.back
    found.stay_lost += done.lost


def _give_back(change: Change, actor: Actor, now: datetime) -> Undone:
    done = Undone([], [])
    for loss in change.losses:
        booking = (
            Booking.objects.select_related("person", "robot", "course").filter(pk=loss["booking"]).first()
        )
        if booking is None:
            continue
        back = loss["how"] == How.USELESS or _restored(booking, loss, actor, now)
        (done.back if back else done.lost).append(booking)
    change.undone_at, change.undone_by = now, actor if isinstance(actor, User) else None
    change.save(update_fields=["undone_at", "undone_by"])
    facts = {"change": str(change.pk), "kind": change.kind, "back": len(done.back), "lost": len(done.lost)}
    record("booking.undo", actor=actor, parameters=facts)
    letters.write_given_back(done.back, actor, now)
    return done


def is_free(booking: Booking, loss: dict[str, Any], now: datetime) -> bool:
    """Return whether the time that a change took from a booking is free, and the booking as the change left it."""
    ends = _before(booking, loss)["held_until"]
    if booking.version != loss["version"] or ends <= now:
        return False
    grace, rest = grace_of(policy_of(booking.robot)), Slot(max(booking.held_until, now), ends)
    others = held_between([booking.robot], rest.starts_at, rest.ends_at).exclude(pk=booking.pk)
    return not any(held_slot(one, grace, now).overlaps(rest) for one in others)


def _before(booking: Booking, loss: dict[str, Any]) -> dict[str, Any]:
    columns: dict[str, Any] = {name: booking._meta.get_field(name) for name in FIELDS}
    return {name: column.to_python(loss["before"][name]) for name, column in columns.items()}


def _restored(booking: Booking, loss: dict[str, Any], actor: Actor, now: datetime) -> bool:
    """Make a booking as it was before a change, unless it changed since, is over, or its time is taken."""
    before = _before(booking, loss)
    try:
        with robot_locked(booking.robot_id, now) as robot:
            if not is_free(booking, loss, now):
                return False
            free_unused(robot, Slot(max(booking.held_until, now), before["held_until"]), now, but=booking)
            for name, value in before.items():
                setattr(booking, name, value)
            stage = stage_of(booking, grace_of(policy_of(robot)), now)
            if stage not in OPEN or stage is Stage.OFFERED or not may_still_be_used(booking, now):
                return False
            save_booking(booking)
            record_booking("booking.restore", booking, actor)
    except BookingRefused:
        return False
    return True
