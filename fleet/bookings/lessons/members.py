"""The people who share a booking."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from uuid import UUID

from django.db.models import Q, QuerySet

from fleet.accounts.models import User
from fleet.bookings.models import Booking, BookingMember, Shared
from robots.access.models import Enrolment


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


def sharers_of(bookings: Collection[Booking]) -> dict[UUID, list[User]]:
    """Return the people who share these bookings beside their owners, by booking: two queries."""
    found: dict[UUID, list[User]] = defaultdict(list)
    shared = [one for one in bookings if one.shared]
    members = BookingMember.objects.filter(booking__in=[one.pk for one in shared]).select_related("person")
    for member in members.order_by("pk"):
        found[member.booking_id].append(member.person)
    courses: dict[int, list[User]] = defaultdict(list)
    lessons = [one for one in shared if one.shared == Shared.COURSE and one.course_id is not None]
    enrolled = Enrolment.objects.filter(course__in={one.course_id for one in lessons}, person__is_active=True)
    for one in enrolled.select_related("person").order_by("person__full_name"):
        courses[one.course_id].append(one.person)
    for lesson in lessons:
        found[lesson.pk] += [one for one in courses[lesson.course_id or 0] if one.pk != lesson.person_id]
    return found


def shared_with(person: User) -> QuerySet[Booking]:
    """Return the bookings of others that this person shares."""
    teams = BookingMember.objects.filter(person=person).values("booking")
    lessons = Q(shared=Shared.COURSE, course__enrolments__person=person, course__archived=False)
    return Booking.objects.filter(Q(pk__in=teams) | lessons).exclude(person=person)
