"""People in line for taken slots: join, leave, offer, accept. For control now: `teleop.control.waiting.line`.

An offer is a booking in state "offered": it holds the slot until its deadline. The transaction that frees the
slot makes the offer; if the clock, a policy or a right freed it, the next transaction that locks the robot's
bookings does so before its own change. So nobody books past the waiting list. Housekeeping ends offers whose
deadline is over, and looks for free slots; several of these processes, or a pause without one, do no harm.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

from django.db import transaction
from django.db.models import Exists, F, OuterRef, Q, QuerySet
from django.dispatch import receiver
from django.utils.translation import gettext as _
from django.utils.translation import override

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.base.formats.dates import dated
from fleet.base.languages import of_person
from fleet.base.zones import zone_of
from fleet.bookings.messages.notifications import in_words, notification_write
from fleet.bookings.models import Booking, State, Waiting
from fleet.bookings.rules import LONGEST, Slot, Wish, refusals
from fleet.bookings.selectors import wish_of
from fleet.bookings.services import (
    BookingRefused,
    check_offer,
    free_unused,
    record_booking,
    require_readable,
    robot_locked,
    save_booking,
    settling,
    state_for,
)
from robots.access.models import Course
from robots.registry.models import Robot
from robots.registry.services import named
from robots.shared.sentences import say
from robots.shared.wire import Refusal

SHORTEST_OFFER = timedelta(minutes=5)
LONGEST_OFFER = timedelta(hours=12)
KEPT = timedelta(days=7)  # how long a waiting person stays stored after the slot began
MOST = 20  # slots for which one person may wait

_NO_OFFER = Refusal("offer_over", "This offer is over. Look at the calendar for another time.", "booking")


@transaction.atomic
def waiting_join(
    *,
    robot: Robot,
    person: User,
    slot: Slot,
    now: datetime,
    purpose: str = "",
    course: Course | None = None,
    record_it: bool = False,
) -> Waiting:
    """Join the waiting list of a slot. Refused if the slot is free, or if another rule refuses to book it.

    The offer gets `purpose`, `course` and `record_it`, as a booking does.
    """
    require_readable(purpose)
    found = refusals(wish_of(robot=robot, person=person, slot=slot, now=now, course=course))
    if not found:
        raise BookingRefused([Refusal("free", "This slot is free: book it.", "booking")])
    if others := [refusal for refusal in found if refusal.code != "taken"]:
        raise BookingRefused(others)
    if Waiting.objects.filter(person=person, ends_at__gt=now).count() >= MOST:
        text = say("You wait for {most} slots already. Leave one of them first.", most=MOST)
        raise BookingRefused([Refusal("waits_enough", text, "booking", {"most": MOST})])
    wanted = {"ends_at": slot.ends_at, "purpose": purpose, "course": course, "record": record_it or None}
    waiting, made = Waiting.objects.update_or_create(
        robot=robot,
        person=person,
        starts_at=slot.starts_at,
        defaults=wanted,
        create_defaults={**wanted, "since": now},
    )
    if made:
        record("booking.wait", actor=person, **_facts(waiting))
    return waiting


@transaction.atomic
def waiting_leave(*, person: User, waiting_id: int) -> None:
    """Leave the waiting list of a slot."""
    waiting = Waiting.objects.select_related("robot").filter(person=person, pk=waiting_id)
    for one in waiting.exclude(starts_at=None):
        one.delete()
        record("booking.wait_end", actor=person, **_facts(one))


def _facts(waiting: Waiting) -> dict[str, Any]:
    """Return the facts of a record about a waiting person."""
    parameters: dict[str, Any] = {
        "person": str(waiting.person_id),
        "from": waiting.starts_at.isoformat() if waiting.starts_at else None,
        "to": waiting.ends_at.isoformat() if waiting.ends_at else None,
    }
    if waiting.record:
        parameters["record"] = True
    private = {"purpose": waiting.purpose} if waiting.purpose else {}
    return {**named(waiting.robot), "parameters": parameters, "private": private}


def keep_waiting_lists(now: datetime) -> None:
    """End the offers whose deadline is over, and offer slots that became free with time."""
    for booking in Booking.objects.filter(state=State.OFFERED, offer_until__lte=now):
        with robot_locked(booking.robot_id, now):
            lapsed = Booking.objects.select_related("robot", "person").get(pk=booking.pk)
            if lapsed.state == State.OFFERED and lapsed.offer_until and lapsed.offer_until <= now:
                _end_offer(lapsed)
    waiting = _perhaps_free(now).select_related("robot", "person", "course")
    for robot_id in {one.robot_id for one in waiting if _wish_if_free(one.robot, one, now)}:
        with robot_locked(robot_id, now):
            pass  # this makes the offers


@receiver(settling)
def _offer_free_time(*, robot: Robot, now: datetime, **_options: Any) -> None:
    """Offer the robot's free time to the people who wait for it, the first who joined first.

    The caller has locked the robot. The quotas of these people are not locked, because two transactions might
    then wait for each other: `offer_accept` checks them again.
    """
    for waiting in _perhaps_free(now).filter(robot=robot).select_related("person", "course"):
        if (wish := _wish_if_free(robot, waiting, now)) is not None:
            _offer(robot, waiting, wish, now)


def _wish_if_free(robot: Robot, waiting: Waiting, now: datetime) -> Wish | None:
    """Return the wish of a person who waits for a slot, if no rule refuses it now."""
    if waiting.starts_at is None or waiting.ends_at is None:
        return None
    slot = Slot(waiting.starts_at, waiting.ends_at)
    wish = wish_of(robot=robot, person=waiting.person, slot=slot, now=now, course=waiting.course)
    return None if refusals(wish) else wish


def _perhaps_free(now: datetime) -> QuerySet[Waiting]:
    """Return people who wait for a slot without booking, or whose bookings may be no-shows. One query."""
    holds = Booking.objects.filter(
        robot=OuterRef("robot"),
        starts_at__gt=now - LONGEST,
        starts_at__lt=OuterRef("ends_at"),
        held_until__gt=OuterRef("starts_at"),
    ).exclude(Q(held_until=F("starts_at")) | Q(used_at=None, starts_at__lte=now))
    return Waiting.objects.filter(~Exists(holds), starts_at__gt=now)


def forget_past(now: datetime) -> None:
    """Remove people who waited for slots that began long ago.

    They are kept for some days: a clock that jumped ahead may be corrected.
    """
    Waiting.objects.filter(starts_at__lte=now - KEPT).delete()


def offer_accept(*, booking_id: str, actor: User, now: datetime) -> Booking:
    """Turn an offer into a booking, if the rules allow it still. Raises `BookingRefused`."""
    booking = Booking.objects.get(pk=booking_id)
    with robot_locked(booking.robot_id, now) as robot:
        offered = Booking.objects.select_related("person", "course").get(pk=booking_id)
        offered.robot = robot
        over = offered.offer_until is None or offered.offer_until <= now
        if offered.state != State.OFFERED or offered.person_id != actor.pk or over:
            raise BookingRefused([_NO_OFFER])
        offered.course = check_offer(offered, actor, now)
        offered.state, offered.offer_until = state_for(actor, robot, offered.course), None
        offered.made_at = now
        save_booking(offered)
        record_booking("booking.accept", offered, actor, outcome=offered.state)
    return offered


def _offer(robot: Robot, waiting: Waiting, wish: Wish, now: datetime) -> None:
    """Turn a person's place in the waiting list into an offer. The robot is locked."""
    slot = wish.slot
    waiting.delete()
    free_unused(robot, slot, now)
    until = now + min(max((slot.starts_at - now) / 2, SHORTEST_OFFER), LONGEST_OFFER)
    offered = Booking.objects.create(
        robot=robot,
        person=waiting.person,
        course=wish.course,
        purpose=waiting.purpose,
        record=waiting.record,
        starts_at=slot.starts_at,
        ends_at=slot.ends_at,
        held_until=slot.ends_at,
        state=State.OFFERED,
        offer_until=until,
        made_at=now,
    )
    record_booking("booking.offer", offered, None)
    zone = zone_of(waiting.person.time_zone)
    with override(of_person(waiting.person.language)):
        text = _("%(booking)s is free now. Accept it under My bookings before %(time)s.") % {
            "booking": in_words(offered, zone),
            "time": f"{dated(until.astimezone(zone), 'D d M, H:i')} ({zone.key})",
        }
        subject = _("%(robot)s: your turn") % {"robot": robot.name}
    notification_write(to=waiting.person, subject=subject, text=text, now=now, about=[offered])


def _end_offer(booking: Booking) -> None:
    booking.state, booking.held_until, booking.offer_until = State.CANCELLED, booking.starts_at, None
    save_booking(booking)
    record_booking("booking.offer_over", booking, None)
