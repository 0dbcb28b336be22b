"""Notifications about a moment: a slot begins or has ended, a person's turn in a lesson has come.

They are written once, whichever process is first, and disappear when the moment is over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta

from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext, override

from fleet.accounts.models import User
from fleet.base.formats.dates import dated
from fleet.base.languages import of_person
from fleet.base.zones import zone_of
from fleet.bookings.lessons.members import sharers_of
from fleet.bookings.messages.notifications import in_words, passing_write
from fleet.bookings.models import Booking, Notification, State, Turn
from fleet.bookings.schedule import CALL_S

SOON = timedelta(minutes=5)
BEGUN = timedelta(minutes=10)  # so long after the begin of its slot a notification of it is shown
LATE = timedelta(minutes=2)  # an end that nobody noticed for longer is no news any more
ENDED = timedelta(minutes=30)
ADJACENT = timedelta(minutes=15)  # a slot that begins within this time is said by the name of its person


def write_moments(now: datetime) -> None:
    """Write the notifications of slots that begin within five minutes, and of those that have just ended."""
    booked = Booking.objects.filter(state=State.BOOKED).select_related("robot", "person", "course")
    for booking in booked.filter(starts_at__gt=now, starts_at__lte=now + SOON):
        if booking.made_at <= booking.starts_at - SOON:
            _tell_begin(booking, now)
    for booking in booked.filter(ends_at__lte=now, ends_at__gt=now - LATE).exclude(used_at=None):
        _tell_end(booking, now)


def your_turn(turn: Turn, now: datetime) -> None:
    """Tell a person that they are called, in the transaction of the call."""
    robot = turn.booking.robot
    with _as_they_read(turn.person):
        passing_write(
            to=turn.person,
            subject=_("%(robot)s: your turn") % {"robot": robot.name},
            text=_("Take control within %(seconds)d seconds.") % {"seconds": round(CALL_S)},
            now=now,
            path=_page_of(turn.booking),
            until=now + timedelta(seconds=CALL_S),
        )


def _tell_begin(booking: Booking, now: datetime) -> None:
    key = f"begin {booking.pk} {booking.starts_at.timestamp():.0f}"
    minutes = math.ceil((booking.starts_at - now) / timedelta(minutes=1))
    for person, own_key in _untold(booking, key):
        with _as_they_read(person):
            subject = ngettext(
                "%(robot)s: your slot begins in %(minutes)d minute",
                "%(robot)s: your slot begins in %(minutes)d minutes",
                minutes,
            )
            lines = [in_words(booking, zone_of(person.time_zone)), booking.lesson_of, booking.purpose]
            passing_write(
                to=person,
                subject=subject % {"robot": booking.robot.name, "minutes": minutes},
                text="\n".join(line for line in lines if line),
                now=now,
                path=_page_of(booking),
                until=min(booking.starts_at + BEGUN, booking.ends_at),
                key=own_key,
            )


def _tell_end(booking: Booking, now: datetime) -> None:
    key = f"end {booking.pk} {booking.ends_at.timestamp():.0f}"
    if not (untold := list(_untold(booking, key))):
        return
    later = Booking.objects.filter(robot=booking.robot_id, starts_at__gte=booking.ends_at)
    later = later.exclude(state=State.CANCELLED).select_related("person", "course")
    following = later.order_by("starts_at").first()
    for person, own_key in untold:
        with _as_they_read(person):
            passing_write(
                to=person,
                subject=_("%(robot)s: your slot ended") % {"robot": booking.robot.name},
                text=_next_in_words(following, person, now),
                now=now,
                path=reverse("bookings-mine"),
                until=now + ENDED,
                key=own_key,
            )


def _next_in_words(following: Booking | None, person: User, now: datetime) -> str:
    if following is None or following.starts_at > now + timedelta(days=1):
        return _("Nobody has booked the robot for the next hours.")
    begins = following.starts_at.astimezone(zone_of(person.time_zone))
    if following.starts_at > now + ADJACENT:
        return _("The robot is free until %(time)s.") % {"time": dated(begins, "D d M, H:i")}
    if following.person_id == person.pk:
        return _("Your next slot on it begins at %(time)s.") % {"time": dated(begins, "H:i")}
    name = following.lesson_of or following.person.display_name
    return _("Next, at %(time)s: %(name)s.") % {"time": dated(begins, "H:i"), "name": name}


def _untold(booking: Booking, key: str) -> Iterator[tuple[User, str]]:
    """Return the people of a booking who have no notification of this key, each with the key for them."""
    people = {person.pk: person for person in (booking.person, *sharers_of([booking])[booking.pk])}
    keys = {f"{key} {pk}": person for pk, person in people.items() if person.is_active}
    told = set(Notification.objects.filter(key__in=keys).values_list("key", flat=True))
    return ((person, own) for own, person in keys.items() if own not in told)


def _page_of(booking: Booking) -> str:
    return reverse("control", args=[booking.robot.slug])


@contextmanager
def _as_they_read(person: User) -> Iterator[None]:
    with override(of_person(person.language)), timezone.override(zone_of(person.time_zone)):
        yield
