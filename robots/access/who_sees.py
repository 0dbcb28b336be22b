"""The rule of who sees the names of other people. Every list, stream, calendar, report and export asks it.

The present is for everybody who sees the robot: who has control, waits for it or pressed the stop, whose task goes
on, whose bookings are to come. The past with its names is for the person whom it is about, for supervisors of the
robot, for supervisors of the course of a booking, and for staff. The log itself is for staff; others read their own
records there. `docs/audit.md` has the same rule for readers.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING
from uuid import UUID

from msgspec import Struct

from robots.access.role_rows import given
from robots.access.selectors import courses_managed_by, lab_date
from robots.registry.models import Role

if TYPE_CHECKING:
    from fleet.accounts.models import User


class Reader(Struct, frozen=True):
    """A person who reads, with the robots and courses of which they read the past of others."""

    person: UUID
    robots: frozenset[UUID] | None  # that they supervise now; None: all robots, because they are staff
    courses: frozenset[int]  # that they manage, also after a course is over

    def sees_past(self, robot: UUID | None, people: Collection[UUID] = (), course: int | None = None) -> bool:
        """Return whether this person reads what is over, with its names.

        `robot`: on which it happened; None: on none. `people`: whom it is about. `course`: for which it counted.
        """
        if self.robots is None or self.person in people:
            return True
        return robot in self.robots or course in self.courses


def reader_of(user: User) -> Reader:
    """Return what `user` reads of the past now. Makes two queries; none for staff."""
    if not user.is_active:
        return Reader(user.pk, frozenset(), frozenset())
    if user.is_staff:
        return Reader(user.pk, None, frozenset())
    roles = given([user.pk], None, lab_date())
    supervised = frozenset(one.robot for one in roles if one.role >= Role.SUPERVISOR)
    return Reader(user.pk, supervised, frozenset(courses_managed_by(user).values_list("pk", flat=True)))
