"""The calendar's data: events as the browser's calendar shows them, in the viewer's wall-clock time."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

from fleet.accounts.models import User
from fleet.bookings.models import WEEKDAYS, OutOfService, Policy
from fleet.bookings.rules import day_of, opening_of
from fleet.bookings.selectors import (
    OPEN,
    SWITCHED_OFF,
    Stage,
    grace_of,
    held_between,
    held_slot,
    policies_of,
    stage_of,
)
from fleet.zones import viewers, zone_of
from robots.access.selectors import courses_managed_by, robots_managed_by
from robots.registry.models import Robot

LONGEST = timedelta(days=45)  # of a view
# A week of ten robots has hundreds of bookings: rows are read without making models of them.
_COLUMNS = (
    "id",
    "robot_id",
    "person_id",
    "starts_at",
    "ends_at",
    "held_until",
    "state",
    "used_at",
    "version",
    "course_id",
    "person__full_name",
    "person__username",
)


def calendar(person: User, robots: Iterable[Robot], first: date, last: date, now: datetime) -> dict[str, Any]:
    """Return robots and events from `first` until `last` (not included), days of the viewer's zone.

    Six queries for any number of robots.
    """
    zone, robots, last = viewers(), list(robots), min(last, first + LONGEST)
    starts, ends = day_of(first, zone).starts_at, day_of(last, zone).starts_at
    policies = policies_of(robots)
    slugs = {robot.id: robot.slug for robot in robots}
    graces = {robot.id: grace_of(policies[robot.id]) for robot in robots}
    managed = set(robots_managed_by(person).values_list("pk", flat=True))
    courses = set(courses_managed_by(person).values_list("pk", flat=True))
    held = held_between(robots, starts, ends).values_list(*_COLUMNS, named=True)
    me = person.pk  # a request's user is a lazy object: slow in a loop
    events = [
        _booked(
            row,
            slugs[row.robot_id],
            graces[row.robot_id],
            row.person_id == me,
            row.robot_id in managed or row.course_id in courses,
            zone,
            now,
        )
        for row in held
    ]
    out = OutOfService.objects.filter(robot__in=robots, starts_at__lt=ends).select_related("robot")
    events += [_out(one, ends, zone) for one in out if one.ends_at is None or one.ends_at > starts]
    events += [_off(robot, starts, ends, zone) for robot in robots if not robot.enabled]
    for robot in robots:
        events += _closed(robot, policies[robot.id], first, last, zone)
    return {
        "resources": [{"id": robot.slug, "title": robot.name} for robot in robots],
        "events": events,
        "now": local(now, zone),
    }


def local(moment: datetime, zone: ZoneInfo) -> str:
    """Return a moment as the calendar writes it: wall-clock time without zone."""
    return moment.astimezone(zone).isoformat()[:19]


def _booked(
    row: Any, slug: str, grace: timedelta, mine: bool, manages: bool, zone: ZoneInfo, now: datetime
) -> dict[str, Any]:
    held = held_slot(row, grace, now)
    stage = stage_of(row, grace, now)
    may_change = (mine or manages) and stage in OPEN
    # A week of ten robots has hundreds of events: the library's defaults are left out.
    changeable = {
        "editable": True,
        "startEditable": stage in (Stage.AWAITING, Stage.BOOKED),
        "extendedProps": {"version": row.version},
    }
    return {
        "id": str(row.id),
        "resourceIds": [slug],
        "start": local(held.starts_at, zone),
        "end": local(held.ends_at, zone),
        "title": row.person__full_name or row.person__username,
        "classNames": ["mine" if mine else "other", f"stage-{stage.name.lower()}"],
        **(changeable if may_change else {}),
    }


def _out(period: OutOfService, ends: datetime, zone: ZoneInfo) -> dict[str, Any]:
    return {
        "id": str(period.pk),
        "resourceIds": [period.robot.slug],
        "start": local(period.starts_at, zone),
        "end": local(period.ends_at or ends, zone),
        "title": str(period.get_why_display()),
        "display": "background",
        "classNames": ["out"],
    }


def _off(robot: Robot, starts: datetime, ends: datetime, zone: ZoneInfo) -> dict[str, Any]:
    return {
        "id": f"off-{robot.slug}",
        "resourceIds": [robot.slug],
        "start": local(starts, zone),
        "end": local(ends, zone),
        "title": str(SWITCHED_OFF),
        "display": "background",
        "classNames": ["out"],
    }


def _closed(
    robot: Robot, policy: Policy, first: date, last: date, zone: ZoneInfo
) -> Iterable[dict[str, Any]]:
    """Return the closed hours of each day as background events."""
    if not policy.opening:
        return
    day, lab = first - timedelta(days=1), zone_of("")
    while day <= last:
        whole, opening = day_of(day, lab), opening_of(day, policy.opening, lab)
        times = (
            [(whole.starts_at, whole.ends_at)]
            if opening is None
            else [(whole.starts_at, opening.starts_at), (opening.ends_at, whole.ends_at)]
        )
        for number, (starts, ends) in enumerate(times):
            if starts < ends:
                yield {
                    "id": f"closed-{robot.slug}-{WEEKDAYS[day.weekday()]}-{day}-{number}",
                    "resourceIds": [robot.slug],
                    "start": local(starts, zone),
                    "end": local(ends, zone),
                    "title": "",
                    "display": "background",
                    "classNames": ["closed"],
                }
        day += timedelta(days=1)
