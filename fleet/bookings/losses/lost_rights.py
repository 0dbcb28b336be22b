"""Free the bookings of people who lost the right to drive the robot."""

from __future__ import annotations

import logging
from collections.abc import Collection
from datetime import datetime
from functools import partial
from typing import Any
from uuid import UUID

from django.db import DatabaseError
from django.db.models import F, Q, QuerySet
from django.db.models.signals import post_save
from django.dispatch import receiver
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import User
from fleet.accounts.services import erased
from fleet.audit.errors import AuditUnavailable
from fleet.base.formats.sentences import words_of
from fleet.bookings.losses.collecting import Actor, How, collected, kept_of, lost
from fleet.bookings.models import Booking, Shared, State
from fleet.bookings.rules import Slot, Wish, lost_right, qualified
from fleet.bookings.selectors import wish_of
from fleet.bookings.services import BookingRefused, record_booking, robot_locked, save_booking
from robots.access.selectors import lab_date, lacking, robots_of, roles_on
from robots.access.signals import access_changed, access_changing, publish_access_changed
from robots.registry.models import Robot, Role
from robots.shared.sentences import say
from robots.shared.wire import Refusal

log = logging.getLogger(__name__)

_RIGHTS = ("is_active", "is_staff")
_READ = ("person", "robot", "course")
LESSONS = Q(shared=Shared.COURSE)
_COURSE_OVER = Refusal("course_over", "This course is over.", "booking")
_CLOSED = Refusal("account_inactive", "This account is closed; ask the staff.", "account")


def bookings_free_lost(people: Collection[UUID] | None, now: datetime) -> int:
    """Free the bookings that these people (None: all people) may not use any more. Return how many.

    Future bookings are cancelled. A booking that runs ends now. If a qualification expires within a booking,
    the booking is shortened.

    A booking that was made against the policy, with a reason, stays while its person has an account: control will be
    refused if the person still has no right then. With None, only bookings of people who may not drive the robot now
    are checked. The lessons of an archived course are freed, whoever gives them.
    """
    held = Booking.objects.filter(
        state__in=(State.BOOKED, State.AWAITING, State.OFFERED), held_until__gt=now
    ).filter(held_until__gt=F("starts_at"))
    upcoming = held.exclude(overridden=True, person__is_active=True)
    if people is not None:
        upcoming = upcoming.filter(person_id__in=people)
    found = _doubtful(upcoming, now) if people is None else list(upcoming.select_related(*_READ))
    lessons = held.filter(LESSONS, course__archived=True).select_related(*_READ)
    return sum(_free_if_lost(one, now) for one in {one.pk: one for one in [*found, *lessons]}.values())


def _doubtful(upcoming: QuerySet[Booking], now: datetime) -> list[Booking]:
    """Return the bookings of people who may not drive the robot now, with three queries for each robot."""
    found: list[Booking] = []
    for robot in Robot.objects.filter(pk__in=upcoming.values("robot")):
        bookings = list(upcoming.filter(robot=robot).select_related(*_READ))
        users = {booking.person_id: booking.person for booking in bookings}
        roles, missing = roles_on(robot.id, users.values()), lacking(robot, users.values(), now)
        able = {
            user for user in users if roles.get(user, Role.OBSERVER) >= Role.OPERATOR and user not in missing
        }
        found += [booking for booking in bookings if booking.person_id not in able]
    return found


def _free_if_lost(seen: Booking, now: datetime) -> bool:
    """Free a booking if its person lost the right to it, or free the part after the qualification expires."""
    if _keeps(seen, wish := _wish_for(seen, now)):
        return False
    try:
        with robot_locked(seen.robot_id, now):
            booking = Booking.objects.select_related(*_READ).get(pk=seen.pk)
            if booking.version != seen.version:
                return False
            # The collector has locked all robots before: the read facts are still true. Other robots wait meanwhile.
            if collected() is None and _keeps(booking, wish := _wish_for(booking, now)):
                return False
            if (why := right_lost(booking, wish)) is not None:
                _end(booking, why, now)
            else:
                _shorten(booking, wish, now)
    except BookingRefused:
        return False
    return True


def _wish_for(booking: Booking, now: datetime) -> Wish:
    runs = now > booking.starts_at
    slot = Slot(now, now) if runs else Slot(booking.starts_at, booking.ends_at)
    return wish_of(robot=booking.robot, person=booking.person, slot=slot, now=now, moved=booking)


def may_still_be_used(booking: Booking, now: datetime) -> bool:
    """Return whether the person of a booking has the right to it, for all of its time."""
    return _keeps(booking, _wish_for(booking, now))


def _keeps(booking: Booking, wish: Wish) -> bool:
    ends = wish.qualified_until
    return right_lost(booking, wish) is None and (ends is None or ends >= booking.held_until)


def right_lost(booking: Booking, wish: Wish) -> Refusal | None:
    """Return why the person of a booking has no right to it any more; None: the person has it."""
    if not booking.person.is_active:
        return _CLOSED
    if booking.lesson_of and booking.course is not None and booking.course.archived:
        return _COURSE_OVER
    return lost_right(wish)


def lessons_astray(now: datetime) -> dict[UUID, tuple[Booking, Refusal]]:
    """Return the lessons to come, by key, that are outside of their course's dates, or not on its robots."""
    lessons = Booking.objects.filter(LESSONS, state=State.BOOKED, starts_at__gt=now, course__archived=False)
    robots: dict[int, set[UUID]] = {}
    found = {}
    for booking in lessons.filter(held_until__gt=F("starts_at")).select_related(*_READ):
        course, day = booking.course, lab_date(booking.starts_at)
        if course is None:
            continue
        if course.pk not in robots:
            robots[course.pk] = set(robots_of(course).values_list("pk", flat=True))
        if not course.starts_on <= day <= course.ends_on:
            found[booking.pk] = booking, _COURSE_OVER
        elif booking.robot_id not in robots[course.pk]:
            text = say("{robot} is no robot of this course.", robot=booking.robot.name)
            found[booking.pk] = booking, Refusal("wrong_course", text, "booking")
    return found


def free_lesson(booking: Booking, why: Refusal, now: datetime) -> None:
    """Cancel a lesson to come."""
    with robot_locked(booking.robot_id, now):
        _end(booking, why, now)


def _end(booking: Booking, why: Refusal, now: datetime) -> None:
    before = kept_of(booking)
    how = store_end(booking, why.code, now)
    lost(booking, how, now, before=before, why=partial(words_of, why))


def store_end(booking: Booking, code: str, now: datetime) -> How:
    """Cancel a booking, or end the one that runs. The caller has locked the robot."""
    begun = now > booking.starts_at
    booking.state, booking.offer_until = State.FINISHED if begun else State.CANCELLED, None
    booking.held_until = now if begun else booking.starts_at
    save_booking(booking)
    record_booking("booking.cancel", booking, _actor(), outcome=booking.state, parameters={"why": code})
    return How.ENDED if begun else How.CANCELLED


def _shorten(booking: Booking, wish: Wish, now: datetime) -> None:
    if wish.qualified_until is None:
        return
    kept, before = (
        kept_of(booking),
        {"from": booking.starts_at.isoformat(), "to": booking.ends_at.isoformat()},
    )
    why = qualified(structs.replace(wish, slot=Slot(booking.starts_at, booking.ends_at)))
    booking.ends_at = booking.held_until = wish.qualified_until
    save_booking(booking)
    record_booking("booking.move", booking, _actor(), parameters={"before": before, "why": "unqualified"})
    lost(booking, How.SHORTENED, now, before=kept, why=partial(words_of, why) if why else str)


def _actor() -> Actor | None:
    found = collected()
    return found.actor if found else None


@receiver(access_changing)
def _access_changing(*, people: frozenset[UUID] | None, **_options: Any) -> None:
    """Let the change that is being made free the bookings when it is complete."""
    if (found := collected()) is not None:
        found.rights_changed(people)


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
    if (found := collected()) is not None:
        found.for_good = True
    publish_access_changed([user.pk])


@receiver(post_save, sender=User)
def _account_changed(*, instance: User, created: bool, update_fields: Any, **_options: Any) -> None:
    if not created and (update_fields is None or set(update_fields) & set(_RIGHTS)):
        publish_access_changed([instance.pk])
