"""Who shares a booking."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from uuid import UUID

from django.db.models import Q, QuerySet

from fleet.accounts.models import User
from fleet.bookings.models import Booking, BookingMember, Shared


def shares(booking: Booking, person: User) -> bool:
    """Return whether a person may drive in a booking: it is theirs, or they share it."""
    return booking.person_id == person.pk or shared_with(person).filter(pk=booking.pk).exists()


def teams_of(bookings: Collection[Booking]) -> dict[UUID, list[str]]:
    """Return the names of the people of teams, and of guests, by booking."""
    found: dict[UUID, list[str]] = defaultdict(list)
    members = BookingMember.objects.filter(booking__in=[one.pk for one in bookings]).select_related("person")
    for member in members.order_by("pk"):
        found[member.booking_id].append(member.person.display_name)
    return found


def shared_with(person: User) -> QuerySet[Booking]:
    """Return the bookings of others that this person shares."""
    teams = BookingMember.objects.filter(person=person).values("booking")
    lessons = Q(shared=Shared.COURSE, course__enrolments__person=person, course__archived=False)
    return Booking.objects.filter(Q(pk__in=teams) | lessons).exclude(person=person)
