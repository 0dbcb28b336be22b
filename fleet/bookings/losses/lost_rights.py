"""Free the bookings of people who lost the right to drive the robot."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
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
from fleet.bookings.losses.rights import Wanted, wishes_of
from fleet.bookings.models import Booking, Shared, State
from fleet.bookings.rules import Slot, Wish, lost_right, qualified
from fleet.bookings.services import BookingRefused, record_bookings, robot_locked, robots_locked, save_times
from robots.access.selectors import lab_date, robots_of
from robots.access.signals import access_changed, access_changing, publish_access_changed
from robots.shared.sentences import say
from robots.shared.wire import Refusal

log = logging.getLogger(__name__)

AT_ONCE = 50
_RIGHTS = ("is_active", "is_staff")
LESSONS = Q(shared=Shared.COURSE)
_COURSE_OVER = Refusal("course_over", "This course is over.", "booking")
_CLOSED = Refusal("account_inactive", "This account is closed; ask the staff.", "account")


def bookings_free_lost(people: Collection[UUID] | None, now: datetime) -> int:
    """Free the bookings that these people (None: all people) may not use any more. Return how many.

    Each transaction locks one robot, for `AT_ONCE` bookings at most: people book beside it.

    Future bookings are cancelled. A booking that runs ends now. If a qualification expires within a booking,
    the booking is shortened.

    A booking that was made against the policy, with a reason, stays while its person has an account: control will be
    refused if the person still has no right then. The lessons of an archived course are freed, whoever gives them.
    """
    held = Booking.objects.filter(
        state__in=(State.BOOKED, State.AWAITING, State.OFFERED), held_until__gt=now
    ).filter(held_until__gt=F("starts_at"))
    theirs = Q() if people is None else Q(person__in=people)
    upcoming = theirs & ~Q(overridden=True, person__is_active=True)
    held = held.filter(upcoming | (LESSONS & Q(course__archived=True)))
    by_robot: dict[UUID, list[UUID]] = {}
    for one, _wish in _lost(held, now):
        by_robot.setdefault(one.robot_id, []).append(one.pk)
    return sum(
        _free_lost(robot_id, held.filter(pk__in=keys[begin : begin + AT_ONCE]), now)
        for robot_id, keys in sorted(by_robot.items())
        for begin in range(0, len(keys), AT_ONCE)
    )


def _free_lost(robot_id: UUID, held: QuerySet[Booking], now: datetime) -> int:
    with robot_locked(robot_id, now):
        found = _lost(held, now)  # meanwhile others may have changed them
        ended = [(one, why) for one, wish in found if (why := right_lost(one, wish)) is not None]
        free(ended, now)
        gone = {one.pk for one, _why in ended}
        _shorten([(one, wish) for one, wish in found if one.pk not in gone], now)
    return len(found)


def _lost(held: QuerySet[Booking], now: datetime) -> list[tuple[Booking, Wish]]:
    """Return which of these bookings their people may not use any more, or only a part of them."""
    found = list(held.select_related("person", "robot", "course"))
    return [
        (one, wish) for one, wish in zip(found, _wishes(found, now), strict=True) if not _keeps(one, wish)
    ]


def _wishes(bookings: Collection[Booking], now: datetime) -> list[Wish]:
    wanted = [
        Wanted(
            one.person,
            one.robot,
            Slot(now, now) if now > one.starts_at else Slot(one.starts_at, one.ends_at),
        )
        for one in bookings
    ]
    return wishes_of(wanted, now)


def still_usable(bookings: Collection[Booking], now: datetime) -> set[UUID]:
    """Return the keys of the bookings to which their people have the right, for all of their time."""
    return {one.pk for one, wish in zip(bookings, _wishes(bookings, now), strict=True) if _keeps(one, wish)}


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
    for booking in lessons.filter(held_until__gt=F("starts_at")).select_related("person", "robot", "course"):
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


def free_lessons(found: Collection[tuple[Booking, Refusal]], now: datetime) -> None:
    """Cancel lessons to come."""
    with robots_locked({one.robot_id for one, _why in found}, now):
        free(found, now)


def free(found: Collection[tuple[Booking, Refusal]], now: datetime) -> None:
    """Cancel bookings, or end those that run, each for its reason. The caller has locked their robots."""
    before = [kept_of(one) for one, _why in found]
    ends = store_ends([(one, why.code) for one, why in found], now)
    for (booking, why), kept, how in zip(found, before, ends, strict=True):
        lost(booking, how, now, before=kept, why=partial(words_of, why))


def store_ends(found: Sequence[tuple[Booking, str]], now: datetime) -> list[How]:
    """Store and record that bookings end, each with the code of its reason. The caller has locked their robots."""
    ends: list[How] = []
    for booking, _code in found:
        begun = now > booking.starts_at
        booking.state, booking.offer_until = State.FINISHED if begun else State.CANCELLED, None
        booking.held_until = now if begun else booking.starts_at
        ends.append(How.ENDED if begun else How.CANCELLED)
    save_times([one for one, _code in found])
    facts = [(one, {"outcome": one.state, "parameters": {"why": code}}) for one, code in found]
    record_bookings("booking.cancel", facts, _actor())
    return ends


def _shorten(found: Collection[tuple[Booking, Wish]], now: datetime) -> None:
    """Shorten bookings to the end of the qualification."""
    losses, facts = [], []
    for booking, wish in found:
        if wish.qualified_until is None:
            continue
        times = {"from": booking.starts_at.isoformat(), "to": booking.ends_at.isoformat()}
        why = qualified(structs.replace(wish, slot=Slot(booking.starts_at, booking.ends_at)))
        losses.append((booking, kept_of(booking), partial(words_of, why) if why else str))
        facts.append((booking, {"parameters": {"before": times, "why": "unqualified"}}))
        booking.ends_at = booking.held_until = wish.qualified_until
    save_times([booking for booking, _facts in facts])
    record_bookings("booking.move", facts, _actor())
    for booking, kept, words in losses:
        lost(booking, How.SHORTENED, now, before=kept, why=words)


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
    except (AuditUnavailable, BookingRefused, DatabaseError) as error:  # the change itself is stored
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
