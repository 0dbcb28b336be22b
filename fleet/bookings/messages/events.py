"""One booking as an event of calendar programs (RFC 5545, 5546): in feeds, and attached to e-mails.

Its UID never changes and its SEQUENCE grows with each change, so that programs change or remove the event that they
have.
"""

from __future__ import annotations

from datetime import datetime
from email.utils import parseaddr

from django.conf import settings
from django.urls import reverse
from django.utils.translation import gettext as _
from icalendar import Calendar, Event, vCalAddress

from fleet.accounts.models import User
from fleet.base.web.origin import usual_origin
from fleet.bookings.models import Booking, State

PRODUCT = "-//Fleet console//bookings//EN"
TENTATIVE = (State.AWAITING, State.OFFERED)


def calendar(method: str = "") -> Calendar:
    """Return an empty calendar."""
    found = Calendar()
    found.add("prodid", PRODUCT)
    found.add("version", "2.0")
    if method:
        found.add("method", method)
    return found


def event_of(booking: Booking, who: str, *, named: bool = True) -> Event:
    """Return the event of a booking. `named`: its person, purpose and history may be read."""
    event = Event()
    event.add("uid", f"{booking.pk}@fleet-console")
    event.add("summary", f"{booking.robot.name}: {who}")
    event.add("dtstart", booking.starts_at)
    # A cancelled one holds no time, but an event lasts.
    event.add("dtend", booking.held_until if booking.held_until > booking.starts_at else booking.ends_at)
    # The bookings of a series were made at one moment, so it would name the person of those that are over.
    event.add("dtstamp", booking.made_at if named else booking.starts_at)
    event.add("sequence", booking.version)
    event.add("status", "TENTATIVE" if booking.state in TENTATIVE else "CONFIRMED")
    if named:
        event.add("last-modified", booking.changed_at or booking.made_at)
    if booking.robot.room:
        event.add("location", booking.robot.room)
    link = link_to(booking)
    if link:
        event.add("url", link)
    if lines := [*([booking.purpose] if named and booking.purpose else []), *([link] if link else [])]:
        event.add("description", "\n".join(lines))
    return event


def link_to(booking: Booking) -> str:
    """Return the address of a booking's page; blank if this process does not know the console's address."""
    origin = usual_origin()
    return origin and f"{origin}{reverse('booking', args=[booking.pk])}"


def details_of(booking: Booking) -> str:
    """Return lines about a booking for an e-mail: room, purpose, link."""
    lines = [
        _("Room: %(room)s") % {"room": booking.robot.room} if booking.robot.room else "",
        _("Purpose: %(purpose)s") % {"purpose": booking.purpose} if booking.purpose else "",
        link_to(booking),
    ]
    return "\n".join(line for line in lines if line)


def message_about(booking: Booking, to: User, now: datetime, *, gone: bool = False) -> dict[str, str]:
    """Return an iCalendar message: the person's program enters, changes or removes the event. `gone`: handed away."""
    gone = gone or booking.state == State.CANCELLED
    method = "CANCEL" if gone else "REQUEST"
    event = event_of(booking, booking.lesson_of or booking.person.display_name)
    del event["dtstamp"]
    event.add("dtstamp", now)
    if gone:
        del event["status"], event["sequence"]
        event.add("status", "CANCELLED")
        event.add("sequence", booking.version + 1)
    name, sender = parseaddr(settings.DEFAULT_FROM_EMAIL)
    event.add("organizer", _address(sender, name or "Fleet console"), encode=0)
    attendee = _address(to.email, to.display_name)
    attendee.params["PARTSTAT"], attendee.params["RSVP"] = "ACCEPTED", "FALSE"
    event.add("attendee", attendee, encode=0)
    found = calendar(method)
    found.add_component(event)
    return {"method": method, "text": found.to_ical().decode()}


def _address(address: str, name: str) -> vCalAddress:
    found = vCalAddress(f"mailto:{address}")
    found.params["CN"] = name
    return found
