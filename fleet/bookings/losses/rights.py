"""The rights of many people at once, as the rules check them: a few queries for all, under the lock of a change."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from datetime import date, datetime
from uuid import UUID

from msgspec import Struct

from fleet.accounts.models import User
from fleet.base.zones import viewers, zone_of
from fleet.bookings.models import Policy
from fleet.bookings.rules import Slot, Wish
from fleet.bookings.selectors import days_of
from robots.access.models import Course, Qualification, QualificationGrant
from robots.access.role_rows import OWN, Given, demanded_by, given
from robots.access.selectors import lab_date
from robots.registry.models import Robot, Role


class Wanted(Struct, frozen=True):
    """A time in which a person wants to drive a robot."""

    person: User
    robot: Robot
    slot: Slot


def wishes_of(wanted: Collection[Wanted], now: datetime) -> list[Wish]:
    """Return a wish for each time, in this order, as `selectors.wish_of` does, with the facts of the right only."""
    if not wanted:
        return []
    facts = _Facts(wanted, now)
    policy, lab, zone = Policy(), zone_of(""), viewers()
    found = []
    for one in wanted:
        starts, demands = one.slot.starts_at, facts.demands_on(one)
        held = facts.grants[one.person.pk]
        ends = [until for key in demands if (until := held.get(key)) is not None]
        roles = [facts.role(one, day) for day in days_of(one.slot)]  # a course may end before the slot does
        wish = Wish(
            robot=one.robot.name,
            slot=one.slot,
            now=now,
            policy=policy,
            lab=lab,
            zone=zone,
            role=None if None in roles else min(filter(None, roles)),
            role_until=facts.role_until(one, lab_date(now), lab_date(starts)),
            missing=tuple(
                name
                for key, name in demands.items()
                if key not in held or ((until := held[key]) is not None and until <= starts)
            ),
            qualified_until=min(ends, default=None),
        )
        found.append(wish)
    return found


class _Facts:
    """Roles, demanded qualifications and grants of these people on these robots."""

    def __init__(self, wanted: Collection[Wanted], now: datetime) -> None:
        people = {one.person.pk for one in wanted}
        robots = {one.robot.pk for one in wanted}
        last = max(lab_date(one.slot.ends_at) for one in wanted)
        self._given: dict[tuple[UUID, UUID], list[Given]] = defaultdict(list)
        for source in given(people, robots, lab_date(now), last):
            self._given[source.person, source.robot].append(source)
        keys = {source.course for sources in self._given.values() for source in sources}
        self._courses = Course.objects.in_bulk(keys - {OWN})
        by_robot = demanded_by(robots)
        demands = {key for several in by_robot.values() for key in several}
        names = (
            dict(Qualification.objects.filter(pk__in=demands).values_list("pk", "name")) if demands else {}
        )
        self._demands = {
            robot: {key: name for key, name in names.items() if key in several}
            for robot, several in by_robot.items()
        }
        self.grants: dict[UUID, dict[int, datetime | None]] = defaultdict(dict)
        grants = QualificationGrant.objects.filter(qualification__in=demands, person__in=people)
        for person, key, until in (
            grants.values_list("person", "qualification", "expires_at") if demands else ()
        ):
            self.grants[person][key] = until

    def demands_on(self, one: Wanted) -> dict[int, str]:
        """Return the qualifications that the robot demands of the person. Staff need none."""
        return {} if one.person.is_staff else self._demands[one.robot.pk]

    def role(self, one: Wanted, day: date) -> Role | None:
        """Return the person's role on a day."""
        if not one.person.is_active or one.person.is_staff:
            return Role.STAFF if one.person.is_active else None
        roles = [
            source.role for source in self._given[one.person.pk, one.robot.pk] if self._valid(source, day)
        ]
        return max(roles, default=None)

    def _valid(self, source: Given, day: date) -> bool:
        course = self._courses.get(source.course)
        return course is None or course.starts_on <= day <= course.ends_on

    def role_until(self, one: Wanted, first: date, last: date) -> date | None:
        """Return the last day between two days on which a course lets the person drive the robot, if any."""
        sources = self._given[one.person.pk, one.robot.pk]
        courses = [
            self._courses[each.course]
            for each in sources
            if each.course != OWN and each.role is Role.OPERATOR
        ]
        return max((course.ends_on for course in courses if first <= course.ends_on <= last), default=None)
