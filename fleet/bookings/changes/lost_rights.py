"""Free the bookings of people who lost the right to drive the robot."""

from __future__ import annotations

import logging
from collections.abc import Collection
from datetime import datetime
from functools import partial
from typing import Any
from uuid import UUID

from django.db import DatabaseError
from django.db.models import F, QuerySet
from django.db.models.signals import post_save
from django.dispatch import receiver
from django.utils import timezone
from django.utils.translation import gettext as _
from msgspec import structs

from fleet.accounts.models import User
from fleet.accounts.services import erased
from fleet.audit.errors import AuditUnavailable
from fleet.base.formats.sentences import words_of
from fleet.bookings.messages.notifications import changed_by_another
from fleet.bookings.models import Booking, State
from fleet.bookings.rules import Slot, Wish, lost_right, qualified
from fleet.bookings.selectors import wish_of
from fleet.bookings.services import BookingRefused, record_booking, robot_locked, save_booking
from robots.access.selectors import lacking, roles_on
from robots.access.signals import access_changed, publish_access_changed
from robots.registry.models import Robot, Role
from robots.shared.wire import Refusal

log = logging.getLogger(__name__)

_RIGHTS = ("is_active", "is_staff")


def bookings_free_lost(people: Collection[UUID] | None, now: datetime) -> int:
    """Free the bookings that these people (None: all people) may not use any more. Return how many.

    Future bookings are cancelled. A booking that runs ends now. If a qualification expires within a booking,
    the booking is shortened.

    A booking that was made against the policy, with a reason, stays: control will be refused if the person
    still has no right then. With None, only bookings of people who may not drive the robot now are checked.
    """
    upcoming = (
        Booking.objects.filter(
            state__in=(State.BOOKED, State.AWAITING, State.OFFERED),
            held_until__gt=now,
        )
        .filter(held_until__gt=F("starts_at"))
        .exclude(overridden=True)
    )
    if people is not None:
        upcoming = upcoming.filter(person_id__in=people)
    freed = 0
    for booking in _doubtful(upcoming, now) if people is None else upcoming.select_related("person", "robot"):
        freed += _free_if_lost(booking, now)
    return freed


def _doubtful(upcoming: QuerySet[Booking], now: datetime) -> list[Booking]:
    """Return the bookings of people who may not drive the robot now, with three queries for each robot."""
    found: list[Booking] = []
    for robot in Robot.objects.filter(pk__in=upcoming.values("robot")):
        bookings = list(upcoming.filter(robot=robot).select_related("person", "robot"))
        users = {booking.person_id: booking.person for booking in bookings}
        roles, missing = roles_on(robot.id, users.values()), lacking(robot, users.values(), now)
        able = {
            user for user in users if roles.get(user, Role.OBSERVER) >= Role.OPERATOR and user not in missing
        }
        found += [booking for booking in bookings if booking.person_id not in able]
    return found


def _free_if_lost(seen: Booking, now: datetime) -> bool:
    """Free a booking if its person lost the right to it, or free the part after the qualification expires."""
    if _unlost(seen, now):
        return False
    try:
        with robot_locked(seen.robot_id, now):
            booking = Booking.objects.select_related("person", "robot").get(pk=seen.pk)
            if booking.version != seen.version or _unlost(booking, now):
                return False
            wish = _wish_for(booking, now)
            if (lost := lost_right(wish)) is not None:
                _end(booking, lost, now)
            else:
                _shorten(booking, wish, now)
    except BookingRefused:
        return False
    return True


def _wish_for(booking: Booking, now: datetime) -> Wish:
    runs = now > booking.starts_at
    slot = Slot(now, now) if runs else Slot(booking.starts_at, booking.ends_at)
    return wish_of(robot=booking.robot, person=booking.person, slot=slot, now=now, moved=booking)


def _unlost(booking: Booking, now: datetime) -> bool:
    wish = _wish_for(booking, now)
    ends = wish.qualified_until
    return lost_right(wish) is None and (ends is None or ends >= booking.held_until)


def _end(booking: Booking, lost: Refusal, now: datetime) -> None:
    begun = now > booking.starts_at
    booking.state, booking.offer_until = State.FINISHED if begun else State.CANCELLED, None
    booking.held_until = now if begun else booking.starts_at
    save_booking(booking)
    record_booking("booking.cancel", booking, None, outcome=booking.state, parameters={"why": lost.code})
    changed_by_another(
        booking, None, lambda: _("ended") if begun else _("cancelled"), now, partial(words_of, lost)
    )


def _shorten(booking: Booking, wish: Wish, now: datetime) -> None:
    if wish.qualified_until is None:
        return
    before = {"from": booking.starts_at.isoformat(), "to": booking.ends_at.isoformat()}
    why = qualified(structs.replace(wish, slot=Slot(booking.starts_at, booking.ends_at)))
    booking.ends_at = booking.held_until = wish.qualified_until
    save_booking(booking)
    record_booking("booking.move", booking, None, parameters={"before": before, "why": "unqualified"})
    changed_by_another(booking, None, lambda: _("shortened"), now, partial(words_of, why) if why else str)


@receiver(access_changed)
def _access_changed(*, people: frozenset[UUID] | None, **_options: Any) -> None:
    try:
        bookings_free_lost(people, timezone.now())
    except (AuditUnavailable, DatabaseError) as error:  # the change itself is stored
        log.error(
            "Bookings of people who lost a right were not freed; housekeeping looks within minutes: %s", error
        )


@receiver(erased)
def _account_erased(*, user: User, **_options: Any) -> None:
    publish_access_changed([user.pk])


@receiver(post_save, sender=User)
def _account_changed(*, instance: User, created: bool, update_fields: Any, **_options: Any) -> None:
    if not created and (update_fields is None or set(update_fields) & set(_RIGHTS)):
        publish_access_changed([instance.pk])
