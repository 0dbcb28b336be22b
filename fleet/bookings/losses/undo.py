"""Undo a change within a day, and give back the bookings of a course that is opened again.

Only what is still free comes back: meanwhile others may have booked it, or the person may have lost the right in
another way.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models import Q, QuerySet
from django.dispatch import receiver
from msgspec import Struct, convert

from fleet.accounts.models import ERASED, Erasure, User
from fleet.audit.services import RecordBody, record, record_all
from fleet.bookings.lessons.turns import turns_again
from fleet.bookings.losses import letters
from fleet.bookings.losses.collecting import Actor, How, collected
from fleet.bookings.losses.lost_rights import still_usable
from fleet.bookings.losses.rows import Row, facts_of, may_change, put_back
from fleet.bookings.models import Booking, Change, Turn
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import (
    OPEN,
    Stage,
    grace_of,
    held_between,
    held_slot,
    policies_of,
    stage_of,
)
from fleet.bookings.services import TIMES, free_unused, record_bookings, save_times, settle
from robots.access.models import Course
from robots.access.signals import course_opened, publish_access_changed
from robots.registry.models import Robot
from robots.shared.wire import NotDone, Refusal

UNDO_FOR = timedelta(days=1)

STAYS = (How.USELESS, How.TURN)  # the booking itself is as it was

Pair = tuple[Booking, dict[str, Any]]  # a booking, and what is kept about its loss

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
    turns: list[Turn] = []  # of people who are in line again
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
    gone = Q(username__startswith=ERASED) | Q(pk__in=Erasure.objects.values("person"))
    return bool(closed) and User.objects.filter(gone, pk__in=closed).exists()


@transaction.atomic
def undo(*, change_id: UUID, actor: User, now: datetime) -> Undone:
    """Undo a change: entries, then the bookings that are still free. Raises `UndoRefused`."""
    list(Robot.objects.select_for_update(no_key=True).order_by("pk").values_list("pk"))
    change = Change.objects.select_for_update(of=("self",)).get(pk=change_id)
    if (refusal := undo_refused(change, now, actor)) is not None:
        raise UndoRefused(refusal)
    restored, changed_since = put_back(convert(change.rows, list[Row]))
    bodies = [RecordBody(facts | {"change": str(change.pk)}) for facts in facts_of(restored)]
    record_all("entry.restore", bodies, actor=actor)
    done = _give_back(change, actor, now)
    done.entries = changed_since
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
    """Give the bookings back before anybody who waits gets their time. The caller has locked all robots."""
    pairs = pairs_of(change)
    done = _restored(pairs, actor, now)
    done.turns = turns_again([loss["turn"] for loss in change.losses if "turn" in loss], actor, now)
    for robot in {booking.robot_id: booking.robot for booking, _loss in pairs}.values():
        settle(robot, now)
    change.undone_at, change.undone_by = now, actor if isinstance(actor, User) else None
    change.save(update_fields=["undone_at", "undone_by"])
    facts = {"change": str(change.pk), "kind": change.kind, "back": len(done.back), "lost": len(done.lost)}
    record("booking.undo", actor=actor, parameters=facts)
    letters.write_given_back(done.back, done.turns, actor, now)
    return done


def pairs_of(change: Change) -> list[Pair]:
    """Return the bookings of which a change took something, each with what is kept about its loss."""
    read = Booking.objects.select_related("person", "robot", "course")
    found = read.in_bulk([loss["booking"] for loss in change.losses])
    pairs = [(found.get(UUID(loss["booking"])), loss) for loss in change.losses]
    return [(booking, loss) for booking, loss in pairs if booking is not None]


def free_again(pairs: Collection[Pair], now: datetime) -> dict[UUID, Slot]:
    """Return the bookings that are as a change left them, and whose time it took is free: by key, with this time."""
    robots = {booking.robot_id: booking.robot for booking, _loss in pairs}
    times = [_before(booking, loss)["held_until"] for booking, loss in pairs]
    policies = policies_of(robots.values())
    held: dict[UUID, list[tuple[UUID, Slot]]] = defaultdict(list)
    for one in held_between(robots.values(), now, max([now, *times])):
        held[one.robot_id].append((one.pk, held_slot(one, grace_of(policies[one.robot_id]), now)))
    found = {}
    for (booking, loss), ends in zip(pairs, times, strict=True):
        rest = Slot(max(booking.held_until, now), ends)
        same = booking.version == loss["version"] and ends > now
        others = (slot for key, slot in held[booking.robot_id] if key != booking.pk)
        if same and not any(slot.overlaps(rest) for slot in others):
            found[booking.pk] = rest
    return found


def _before(booking: Booking, loss: dict[str, Any]) -> dict[str, Any]:
    columns: dict[str, Any] = {name: booking._meta.get_field(name) for name in TIMES}
    return {name: column.to_python(loss["before"][name]) for name, column in columns.items()}


def _restored(pairs: list[Pair], actor: Actor, now: datetime) -> Undone:
    """Make bookings as they were before a change, unless they changed since, are over, or their time is taken."""
    stay = [booking for booking, loss in pairs if loss["how"] == How.USELESS]
    taken = [pair for pair in pairs if pair[1]["how"] not in STAYS]
    free = free_again(taken, now)
    for booking, loss in taken:
        for name, value in _before(booking, loss).items() if booking.pk in free else ():
            setattr(booking, name, value)
    usable = still_usable([booking for booking, _loss in taken if booking.pk in free], now)
    policies = policies_of({booking.robot_id: booking.robot for booking, _loss in taken}.values())
    begun = Booking.objects.filter(robot__in=policies, starts_at__lte=now, held_until__gt=now, used_at=None)
    unused = set(begun.values_list("robot", flat=True))
    back: list[Booking] = []
    gone: list[Booking] = []
    for booking, _loss in taken:
        stage = stage_of(booking, grace_of(policies[booking.robot_id]), now)
        returns = booking.pk in usable and stage in OPEN and stage is not Stage.OFFERED
        (back if returns else gone).append(booking)
        if returns and booking.robot_id in unused:
            free_unused(booking.robot, free[booking.pk], now, but=booking)
    save_times(back)
    record_bookings("booking.restore", [(booking, {}) for booking in back], actor)
    return Undone([*stay, *back], gone)
