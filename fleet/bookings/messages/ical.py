"""Bookings as an iCalendar feed (RFC 5545), at private addresses that can be revoked."""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta
from hashlib import sha256

from django.db import transaction
from django.db.models import Q, QuerySet
from django.utils.translation import get_language, override
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.base.languages import chosen
from fleet.bookings.lessons.members import shared_with
from fleet.bookings.messages.events import calendar, event_of
from fleet.bookings.models import Booking, FeedAddress, State
from fleet.bookings.permissions import shows_person
from fleet.bookings.selectors import grace_of, policies_of, stage_of
from robots.access.selectors import robots_bookable_by
from robots.access.who_sees import Reader, reader_of
from robots.registry.models import Robot
from robots.registry.services import named

PAST = timedelta(days=31)  # how far a feed goes back


@transaction.atomic
def address_make(*, person: User, robot: Robot | None, now: datetime) -> str:
    """Return the token of a new private address; the old one of the same purpose ends."""
    address_revoke(person=person, robot=robot)
    token = secrets.token_urlsafe(24)
    FeedAddress.objects.create(digest=_digest(token), person=person, robot=robot, made_at=now)
    record("booking.feed", actor=person, **named(robot))
    return token


@transaction.atomic
def address_revoke(*, person: User, robot: Robot | None) -> None:
    """End the private address, if there is one."""
    if FeedAddress.objects.filter(person=person, robot=robot).delete()[0]:
        record("booking.feed_end", actor=person, **named(robot))


def feed_of(token: str, now: datetime) -> bytes | None:
    """Return the feed of a private address; None: it was revoked, or the person may not see it any more."""
    address = FeedAddress.objects.filter(digest=_digest(token)).select_related("person", "robot").first()
    if address is None or not address.person.is_active:
        return None
    bookings = Booking.objects.filter(held_until__gt=now - PAST).exclude(state=State.CANCELLED)
    reader = reader_of(address.person)
    with override(chosen(address.person.language) or get_language()):
        if address.robot is None:
            mine = Q(person=address.person) | Q(pk__in=shared_with(address.person).values("pk"))
            return _calendar(address.person.display_name, bookings.filter(mine), reader, now)
        if not robots_bookable_by(address.person).filter(pk=address.robot.pk).exists():
            return None
        return _calendar(address.robot.name, bookings.filter(robot=address.robot), reader, now)


def _calendar(name: str, bookings: QuerySet[Booking], reader: Reader, now: datetime) -> bytes:
    feed = calendar()
    feed.add("x-wr-calname", name)
    found = list(bookings.select_related("robot", "person", "course"))
    policies = policies_of({booking.robot for booking in found})
    for booking in found:
        stage = stage_of(booking, grace_of(policies[booking.robot_id]), now)
        named = shows_person(reader, booking, stage)
        who = booking.lesson_of or (booking.person.display_name if named else _("booked"))
        feed.add_component(event_of(booking, who, named=named))
    return bytes(feed.to_ical())


def _digest(token: str) -> str:
    return sha256(token.encode()).hexdigest()
