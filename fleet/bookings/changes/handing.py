"""Hand a booking to a colleague, who is asked first, by name or by a link. It counts for them if they accept.

People who are named to share a booking are asked the same way.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from functools import partial
from hashlib import sha256
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models import F, Q, QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import override

from fleet.accounts.models import User
from fleet.base.formats.dates import dated
from fleet.base.languages import of_person
from fleet.base.zones import zone_of
from fleet.bookings.messages.notifications import in_words, notification_write
from fleet.bookings.models import Booking, BookingMember, HandOffer, State
from fleet.bookings.permissions import may_book_for, may_manage_booking
from fleet.bookings.rules import Slot
from fleet.bookings.services import (
    NOT_YOURS,
    BookingRefused,
    booking_hand,
    booking_make,
    changeable,
    record_booking,
    require_accepted,
    require_shareable,
    robot_locked,
)
from robots.access.models import Course, GroupRole
from robots.access.role_rows import given
from robots.access.selectors import lab_date, manages_robot
from robots.registry.models import Robot, RobotRole, Role
from robots.shared.wire import Refusal

OPEN_FOR = timedelta(days=1)
LEAST = timedelta(minutes=10)  # also for a slot that begins before, or runs
MOST_COLLEAGUES = 500
KEPT = timedelta(days=30)

_OVER = Refusal("offer_over", "This offer is over. Look at the calendar for another time.", "booking")
_SHARED = (State.BOOKED, State.AWAITING)
_TO_SHARE = Q(outcome="", share=True, booking__state__in=_SHARED)
_TO_TAKE = Q(outcome="", share=False, version=F("booking__version"))


def colleagues_of(person: User, booking: Booking) -> list[User]:
    """Return whom the person may name to hand a booking to: people of their courses on the robot who may drive then.

    For supervisors of the robot: everybody who may.
    """
    robot, day = booking.robot, lab_date(booking.starts_at)
    courses = Course.objects.filter(Q(robots=robot) | Q(groups__robots=robot), archived=False)
    manages = manages_robot(person, robot)
    if not manages:
        courses = courses.filter(Q(enrolments__person=person) | Q(supervisors=person))
    inside = Q(enrolments__course__in=courses) | Q(supervised_courses__in=courses)
    if manages:
        by_group = GroupRole.objects.filter(group__robots=robot).values("user")
        inside |= Q(pk__in=RobotRole.objects.filter(robot=robot).values("user")) | Q(pk__in=by_group)
        inside |= Q(is_staff=True)
    people = list(User.objects.filter(inside, is_active=True).exclude(pk=booking.person_id).distinct())
    drive = {
        one.person for one in given([one.pk for one in people], [robot.pk], day) if one.role >= Role.OPERATOR
    }
    able = [one for one in people if one.is_staff or one.pk in drive]
    return sorted(able, key=lambda one: one.display_name.lower())[:MOST_COLLEAGUES]


def hand_ask(
    *, booking_id: UUID, version: int, to: User | None, actor: User, now: datetime
) -> tuple[HandOffer, str]:
    """Ask a colleague to take a booking; `to` None: whoever opens the link. Return the offer, and the link's code.

    A colleague whom the rules refuse is refused at once. A new question replaces an open one. Raises `BookingRefused`.
    """
    with changeable(booking_id, actor, version, now) as booking:
        require_accepted(booking)
        if to is not None:
            _try(booking_id=booking_id, version=version, to=to, actor=actor, now=now)
        for earlier in HandOffer.objects.filter(booking=booking, outcome="", share=False).select_related(
            "to"
        ):
            _end(earlier, booking, HandOffer.Outcome.WITHDRAWN, actor, now)
        code = "" if to else secrets.token_urlsafe(24)
        offer = HandOffer.objects.create(
            booking=booking,
            version=booking.version,
            by=actor,
            to=to,
            digest=_digest(code) if code else "",
            made_at=now,
            until=min(max(min(now + OPEN_FOR, booking.starts_at), now + LEAST), booking.ends_at),
        )
        facts = {"to": str(to.pk) if to else None, "until": offer.until.isoformat()}
        record_booking("booking.hand_ask", booking, actor, parameters=facts)
        if to is not None:
            _tell_asked(offer, booking, to, now)
    return offer, code


def booking_make_asking(
    *,
    robot: Robot,
    person: User,
    actor: User,
    slot: Slot,
    team: Sequence[User],
    now: datetime,
    **options: Any,
) -> Booking:
    """Book a slot, and ask its team, except people for whom the actor may book. Raises `BookingRefused`."""
    asked = [one for one in team if not may_book_for(actor, one, robot, slot.starts_at)]
    booking = booking_make(
        robot=robot, person=person, actor=actor, slot=slot, team=team, asked=asked, now=now, **options
    )
    for to in asked:
        with transaction.atomic():
            offer = HandOffer.objects.create(
                booking=booking,
                version=booking.version,
                share=True,
                by=actor,
                to=to,
                made_at=now,
                until=slot.ends_at,
            )
            facts = {"to": str(to.pk), "until": offer.until.isoformat(), "shared": True}
            record_booking("booking.hand_ask", booking, actor, parameters=facts)
            _tell_asked(offer, booking, to, now)
    return booking


def asked_to_share(booking: Booking, now: datetime) -> list[str]:
    """Return the names of those who have not answered yet whether they share a booking."""
    found = HandOffer.objects.filter(_TO_SHARE, booking=booking, until__gt=now).select_related("to")
    return [one.to.display_name for one in found.order_by("made_at") if one.to]


def hand_answer(*, offer_id: UUID, actor: User, accept: bool, now: datetime, code: str = "") -> Booking:
    """Accept an offer, or decline it: for the person who was asked, or who has the link. Raises `BookingRefused`."""
    robot = HandOffer.objects.values_list("booking__robot", flat=True).get(pk=offer_id)
    with robot_locked(robot, now):  # first, as in `hand_ask`
        found = HandOffer.objects.select_for_update(of=("self",)).select_related("booking", "by")
        offer = found.get(pk=offer_id)
        asked = offer.to_id == actor.pk if offer.to_id else bool(code) and offer.digest == _digest(code)
        if not asked or offer.outcome or offer.until <= now or actor.pk == offer.booking.person_id:
            raise BookingRefused([_OVER])
        booking = offer.booking
        if accept and offer.share:
            _join(offer, booking, actor, now)
        elif accept:
            offer.outcome = HandOffer.Outcome.ACCEPTED
            offer.save(update_fields=["outcome"])
            booking = booking_hand(
                booking_id=offer.booking_id, version=offer.version, to=actor, actor=offer.by, now=now
            )
            _tell(offer.by, booking, partial(_accepted, actor), now, about=[booking], gone=True)
        elif offer.to_id:
            _end(offer, booking, HandOffer.Outcome.DECLINED, actor, now)
    return booking


def hand_withdraw(*, offer_id: UUID, actor: User, now: datetime) -> None:
    """Withdraw an open offer: for who made it, the booking's person, its managers. Raises `BookingRefused`."""
    with transaction.atomic():
        offer = (
            HandOffer.objects.select_for_update(of=("self",)).select_related("booking", "to").get(pk=offer_id)
        )
        booking = offer.booking
        if actor.pk not in (offer.by_id, booking.person_id) and not may_manage_booking(actor, booking):
            raise BookingRefused([NOT_YOURS])
        if not offer.outcome:
            _end(offer, booking, HandOffer.Outcome.WITHDRAWN, actor, now)


def hand_offers_lapse(now: datetime) -> None:
    """End the offers that nobody answered, and tell those who made them."""
    for offer in HandOffer.objects.filter(outcome="", until__lte=now).select_related("booking", "by"):
        with transaction.atomic():
            lapsed = HandOffer.objects.filter(pk=offer.pk, outcome="").update(
                outcome=HandOffer.Outcome.LAPSED
            )
            if lapsed and not offer.share:  # that slot is over
                _tell(offer.by, offer.booking, lambda: _("nobody accepted it in time"), now)


def remove_old_offers(now: datetime) -> None:
    """Remove offers after `KEPT`. The log has their records."""
    HandOffer.objects.filter(until__lt=now - KEPT).delete()


def offers_to(person: User, now: datetime) -> QuerySet[HandOffer]:
    """Return the open offers to a person, that of the earliest slot first."""
    found = HandOffer.objects.filter(_TO_TAKE | _TO_SHARE, to=person, until__gt=now)
    return found.select_related("booking__robot", "booking__person", "by").order_by("booking__starts_at")


def offer_of(booking: Booking, now: datetime) -> HandOffer | None:
    """Return the open offer to take a booking."""
    return HandOffer.objects.filter(_TO_TAKE, booking=booking, until__gt=now).select_related("to").first()


def offer_with(code: str, now: datetime) -> HandOffer | None:
    """Return the open offer with this link."""
    found = HandOffer.objects.filter(_TO_TAKE, digest=_digest(code), until__gt=now)
    return found.select_related("booking__robot", "booking__person", "by").first()


class _Tried(Exception):
    """The trial went well."""


def _try(**asked: Any) -> None:
    """Refuse what would be refused to the colleague, and hand nothing over."""
    try:
        with transaction.atomic():
            booking_hand(**asked)
            raise _Tried
    except _Tried:
        pass


def _join(offer: HandOffer, booking: Booking, actor: User, now: datetime) -> None:
    """Put the person who accepted into the booking's team. Raises `BookingRefused`."""
    if booking.state not in _SHARED or booking.held_until <= now:
        raise BookingRefused([_OVER])
    robot, at = booking.robot, max(now, booking.starts_at)
    require_shareable(robot, booking.person, [actor], booking.turn_min, at, lesson=False)
    offer.outcome = HandOffer.Outcome.ACCEPTED
    offer.save(update_fields=["outcome"])
    BookingMember.objects.get_or_create(booking=booking, person=actor)
    record_booking("booking.join", booking, actor)
    _tell(offer.by, booking, partial(_accepted, actor), now)


def _end(offer: HandOffer, booking: Booking, outcome: HandOffer.Outcome, actor: User, now: datetime) -> None:
    """End an offer without handing the booking over, and tell the other side."""
    offer.outcome = outcome
    offer.save(update_fields=["outcome"])
    record_booking("booking.hand_end", booking, actor, outcome=outcome.value)
    if outcome is HandOffer.Outcome.DECLINED:
        _tell(offer.by, booking, lambda: _("%(name)s declined it") % {"name": actor.display_name}, now)
    elif offer.to is not None:
        _tell(offer.to, booking, lambda: _("it is offered to you no more"), now)


def _tell_asked(offer: HandOffer, booking: Booking, to: User, now: datetime) -> None:
    zone = zone_of(to.time_zone)
    with override(of_person(to.language)):
        words = _("%(name)s wants to hand you a booking of %(robot)s")
        if offer.share:
            words = _("%(name)s asks you to share a booking of %(robot)s")
        subject = words % {"name": offer.by.display_name, "robot": booking.robot.name}
        answer = _("Accept or decline it under My bookings before %(time)s.") % {
            "time": f"{dated(offer.until.astimezone(zone), 'D d M, H:i')} ({zone.key})"
        }
    notification_write(to=to, subject=subject, text=f"{in_words(booking, zone)}\n{answer}", now=now)


def _accepted(by: User) -> str:
    return _("%(name)s accepted it") % {"name": by.display_name}


def _tell(person: User, booking: Booking, what: Callable[[], str], now: datetime, **event: Any) -> None:
    with override(of_person(person.language)):
        subject = _("Your booking of %(robot)s: %(what)s") % {"robot": booking.robot.name, "what": what()}
    text = in_words(booking, zone_of(person.time_zone))
    notification_write(to=person, subject=subject, text=text, now=now, **event)


def _digest(code: str) -> str:
    return sha256(code.encode()).hexdigest()
