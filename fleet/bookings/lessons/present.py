"""The bookings of a schedule that people share, and who waits for a turn in the present one. Read often."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from uuid import UUID

from msgspec import Struct

from fleet.base.database import rows
from fleet.bookings.models import BookingMember, Shared
from fleet.bookings.schedule import Schedule
from robots.access.models import Enrolment

_LINE = """
SELECT t.id, t.person_id, COALESCE(NULLIF(u.full_name, ''), u.username), t.left_s
FROM bookings_turn t JOIN accounts_user u ON u.id = t.person_id
WHERE t.booking_id = %s AND t.state = 'waiting'
ORDER BY t.number, t.id
"""


class InLine(Struct, frozen=True):
    """A person who waits for a turn."""

    id: int
    person: UUID
    name: str
    left_s: int | None  # of a turn that was interrupted; None: a whole turn


class Sharing(Struct, frozen=True):
    """The people who share the bookings of a schedule, and the line of the present one."""

    shares: dict[UUID, frozenset[UUID]] = {}  # by person: bookings of others in which they may drive
    line: tuple[InLine, ...] = ()

    def of(self, person: UUID) -> frozenset[UUID]:
        """Return the bookings of others that this person shares."""
        return self.shares.get(person, frozenset())


def sharing_of(schedule: Schedule, people: Collection[UUID]) -> Sharing:
    """Return which of these people share which bookings. No query if nobody can share one."""
    current = schedule.current
    coming = [one for one in schedule.next if one.shared == Shared.PEOPLE]
    teams = [one.id for one in (current, *coming) if one is not None]
    others = [person for person in people if current is None or person != current.person]
    if not teams or not (others or (current and current.turn_min)):
        return Sharing()
    shares: dict[UUID, set[UUID]] = defaultdict(set)
    members = BookingMember.objects.filter(booking__in=teams, person__in=others)
    for booking, person in members.values_list("booking_id", "person_id"):
        shares[person].add(booking)
    if current is None:
        return Sharing({person: frozenset(found) for person, found in shares.items()})
    if current.shared == Shared.COURSE:
        enrolled = Enrolment.objects.filter(
            course__bookings=current.id, course__archived=False, person__in=others
        )
        for person in enrolled.values_list("person_id", flat=True):
            shares[person].add(current.id)
    line = line_of_turns(current.id) if current.turn_min else ()
    return Sharing({person: frozenset(found) for person, found in shares.items()}, line)


def line_of_turns(booking: UUID) -> tuple[InLine, ...]:
    """Return the people who wait for a turn, the next one first."""
    return tuple(
        InLine(key, rows.key(person), name, left_s)
        for key, person, name, left_s in rows.read(_LINE, [booking])
    )
