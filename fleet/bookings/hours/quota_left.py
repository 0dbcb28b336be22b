"""The time that is left of quotas, of a person and of a whole course, in the lab's present day and week."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from django.db.models import F
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.base.formats.sentences import in_words
from fleet.base.zones import zone_of
from fleet.bookings.hours.driven import driven
from fleet.bookings.models import Booking, Policy, Shared
from fleet.bookings.rules import LONGEST, Slot, day_of, duration, week_of
from fleet.bookings.selectors import policies_of
from robots.access.models import DRIVERS, Course
from robots.access.selectors import lab_date, robots_visible_to, roles_of
from robots.registry.models import Role


class Left(Struct, frozen=True):
    """The texts about the time that is left of the quotas of one course, or of one policy."""

    of: str
    rests: tuple[str, ...]


def left_of(person: User, now: datetime) -> list[Left]:
    """Return how much a person may still book, by their courses and by the policies of their robots."""
    own = list(_counted(now, person=person))
    found = []
    for course in _courses_of(person, now):
        mine = [slot for slot, key in own if key == course.pk] + _driven(course, now, person)
        found.append(Left(course.name, (*_rests(course, mine, now), *common_left(course, now))))
    slots = [slot for slot, _key in own]
    found += [Left(policy.of, tuple(_rests(policy, slots, now))) for policy in _policies_of(person)]
    return [one for one in found if one.rests]


def common_left(course: Course, now: datetime) -> tuple[str, ...]:
    """Return the text about the time left of the quota of a whole course; nothing without such a quota."""
    if course.course_week_min is None:
        return ()
    slots = [slot for slot, _key in _counted(now, course=course)] + _driven(course, now)
    rest = _rest(course.course_week_min, slots, _week(now))
    return (_("%(rest)s this week for the whole course") % {"rest": rest},)


def _counted(now: datetime, **of: User | Course) -> Iterable[tuple[Slot, int | None]]:
    """Yield the slots from this week on that are no lessons, each with the key of its course."""
    since = _week(now).starts_at - LONGEST
    rows = Booking.objects.filter(starts_at__gt=since, held_until__gt=F("starts_at"), **of)
    no_lessons = rows.exclude(shared=Shared.COURSE)
    for starts, ends, course in no_lessons.values_list("starts_at", "held_until", "course_id"):
        yield Slot(starts, ends), course


def _driven(course: Course, now: datetime, person: User | None = None) -> list[Slot]:
    """Return the time that was driven in lessons of this week, if the course counts it."""
    if course.lessons_count != DRIVERS:
        return []
    lessons = course.bookings.filter(shared=Shared.COURSE, starts_at__gt=_week(now).starts_at - LONGEST)
    return [slot for _who, slot in driven(lessons, now, person)]


def _courses_of(person: User, now: datetime) -> Iterable[Course]:
    today = lab_date(now)
    return Course.objects.filter(
        enrolments__person=person,
        role=Role.OPERATOR,
        archived=False,
        starts_on__lte=today,
        ends_on__gte=today,
    )


def _policies_of(person: User) -> Iterable[Policy]:
    robots = list(robots_visible_to(person))
    roles = roles_of(person, robots)
    driven = [robot for robot in robots if roles.get(robot.id, Role.OBSERVER) >= Role.OPERATOR]
    return {policy.pk: policy for policy in policies_of(driven).values()}.values()


def _rests(quota: Course | Policy, slots: list[Slot], now: datetime) -> list[str]:
    words = []
    if quota.day_min is not None:
        today = day_of(lab_date(now), zone_of(""))
        words.append(_("%(rest)s today") % {"rest": _rest(quota.day_min, slots, today)})
    if quota.week_min is not None:
        words.append(_("%(rest)s this week") % {"rest": _rest(quota.week_min, slots, _week(now))})
    if quota.at_once is not None:
        to_come = sum(1 for slot in slots if slot.ends_at > now)
        facts = {"left": max(0, quota.at_once - to_come), "most": quota.at_once}
        words.append(_("%(left)d of %(most)d bookings to come") % facts)
    return words


def _rest(most_min: int, slots: list[Slot], period: Slot) -> str:
    left = max(0.0, most_min - sum(period.shared_minutes(slot) for slot in slots))
    return _("%(left)s of %(most)s") % {
        "left": in_words(duration(left)),
        "most": in_words(duration(most_min)),
    }


def _week(now: datetime) -> Slot:
    return week_of(lab_date(now), zone_of(""))
