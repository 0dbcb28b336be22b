"""The calendar's data: events for the calendar in the browser, in the viewer's wall-clock time."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date, datetime, timedelta
from functools import cache, partial
from typing import Any
from uuid import UUID
from zoneinfo import ZoneInfo

from django.utils.translation import gettext as _
from msgspec import UNSET, Struct, UnsetType

from fleet.accounts.models import User
from fleet.base.database import rows
from fleet.base.formats.dates import dated
from fleet.base.zones import viewers, zone_of
from fleet.bookings import rules
from fleet.bookings.lessons.members import shared_with
from fleet.bookings.models import WEEKDAYS, Holiday, OutOfService, Policy
from fleet.bookings.permissions import shows_person
from fleet.bookings.rules import day_of, opening_of
from fleet.bookings.selectors import (
    OPEN,
    SWITCHED_OFF,
    Stage,
    grace_of,
    held_slot,
    policies_of,
    stage_of,
)
from robots.access.selectors import robots_managed_by
from robots.access.who_sees import reader_of
from robots.registry.models import Robot
from robots.shared.sentences import is_shown_twice

DAY = timedelta(days=1)
LONGEST = timedelta(days=45)  # the longest time that a view shows

# A week of ten robots has hundreds of bookings, and many begin at the same time. For speed, rows are not made
# into models, and each time is parsed and formatted only once.
_HELD = """
SELECT b.id, b.robot_id, r.slug, b.person_id, b.course_id, CAST(b.starts_at AS text), CAST(b.held_until AS text),
    CAST(b.used_at AS text), b.state, b.version, COALESCE(NULLIF(p.full_name, ''), p.username),
    CASE WHEN b.shared = 'course' THEN c.name END
FROM bookings_booking b JOIN robots_robot r ON r.id = b.robot_id JOIN accounts_user p ON p.id = b.person_id
    LEFT JOIN access_course c ON c.id = b.course_id
WHERE b.robot_id IN ({robots}) AND b.starts_at > %s AND b.starts_at < %s AND b.held_until > %s
    AND b.held_until > b.starts_at
ORDER BY b.starts_at
"""


class Event(Struct, kw_only=True, omit_defaults=True, rename="camel"):
    """An event of the calendar in the browser. Values that are the calendar's defaults are left out."""

    id: UUID | str
    resource_ids: tuple[str]  # the robot
    start: str
    end: str
    title: str
    display: str | UnsetType = UNSET
    class_names: tuple[str, ...]
    editable: bool | UnsetType = UNSET
    start_editable: bool | UnsetType = UNSET
    extended_props: dict[str, int | str] | UnsetType = UNSET


class _Row(Struct):
    """The columns of a booking that decide about its held time, its stage, and who reads its person."""

    robot_id: UUID
    person_id: UUID
    course_id: int | None
    starts_at: datetime
    held_until: datetime
    used_at: datetime | None
    state: str


def calendar(person: User, robots: Iterable[Robot], first: date, last: date, now: datetime) -> dict[str, Any]:
    """Return robots and events from day `first` until day `last` (not included) in the viewer's zone.

    Eight queries for any number of robots.
    """
    zone, robots, last = viewers(), list(robots), min(last, first + LONGEST)
    starts, ends = day_of(first, zone).starts_at, day_of(last, zone).starts_at
    policies = policies_of(robots)
    events = _booked(person, robots, policies, starts, ends, zone, now)
    out = OutOfService.objects.filter(robot__in=robots, starts_at__lt=ends)
    slugs = {robot.id: robot.slug for robot in robots}
    events += [
        _background(
            one.pk,
            slugs[one.robot_id],
            span(one.starts_at, one.ends_at or ends, zone),
            str(one.get_why_display()),
        )
        for one in out
        if one.ends_at is None or one.ends_at > starts
    ]
    shown = local(starts, zone), local(ends, zone)
    events += [
        _background(f"off-{robot.slug}", robot.slug, shown, str(SWITCHED_OFF))
        for robot in robots
        if not robot.enabled
    ]
    holidays = list(Holiday.objects.filter(last_day__gte=first - DAY, first_day__lte=last))
    for robot in robots:
        events += _closed(robot, policies[robot.id], first, last, zone)
        events += [_holiday(one, robot.slug, zone) for one in holidays]
    return {
        "resources": [{"id": robot.slug, "title": robot.name} for robot in robots],
        "events": events,
        "now": local(now, zone),
    }


def local(moment: datetime, zone: ZoneInfo) -> str:
    """Return a moment in the calendar's format: wall-clock time without zone."""
    return moment.astimezone(zone).isoformat()[:19]


def span(starts: datetime, ends: datetime, zone: ZoneInfo) -> tuple[str, str]:
    """Return begin and end in the calendar's format.

    An end that the clock shows before the begin, or at it, because clocks go back, is drawn by the real duration.
    """
    shown = ends.astimezone(zone).replace(tzinfo=None)
    begins = starts.astimezone(zone).replace(tzinfo=None)
    drawn = begins + (ends - starts) if shown <= begins else shown
    return begins.isoformat()[:19], drawn.isoformat()[:19]


def times_of_day(starts: datetime, ends: datetime, zone: ZoneInfo) -> str:
    """Return begin and end, with their offsets, if the clock shows one of them twice: "02:30 (UTC+1) - 03:30"."""
    local = [moment.astimezone(zone) for moment in (starts, ends)]
    return " - ".join(dated(one, "H:i") for one in local) if any(map(is_shown_twice, local)) else ""


def _booked(
    person: User,
    robots: list[Robot],
    policies: dict[UUID, Policy],
    starts: datetime,
    ends: datetime,
    zone: ZoneInfo,
    now: datetime,
) -> list[Event]:
    """Return the bookings that hold time between two moments."""
    if not robots:
        return []
    managed = set(robots_managed_by(person).values_list("slug", flat=True))
    reader = reader_of(person)
    graces = {robot.slug: grace_of(policies[robot.id]) for robot in robots}
    moment, known, written = cache(rows.moment), cache(rows.key), cache(partial(span, zone=zone))
    written_times = cache(partial(times_of_day, zone=zone))
    shared = set(
        shared_with(person).filter(held_until__gt=starts, starts_at__lt=ends).values_list("pk", flat=True)
    )
    query = _HELD.format(robots=rows.marks(robots))
    asked = (*(robot.id for robot in robots), starts - rules.LONGEST, ends, starts)
    events = []
    for key, robot, slug, owner, course, *times, state, version, name, lesson in rows.read(query, asked):
        starts_at, held_until, used_at = (at and moment(at) for at in times)
        row = _Row(known(robot), known(owner), course, starts_at, held_until, used_at, state)
        mine = row.person_id == person.pk
        joined = known(key) in shared
        held = held_slot(row, graces[slug], now)
        stage = stage_of(row, graces[slug], now)
        starts_at, ends_at = written(held.starts_at, held.ends_at)
        event = Event(
            id=rows.key(key),
            resource_ids=(slug,),
            start=starts_at,
            end=ends_at,
            title=lesson or (name if shows_person(reader, row, stage) else _("Booked")),
            class_names=("mine" if mine or joined else "other", f"stage-{stage.name.lower()}"),
        )
        if stage in OPEN and (mine or slug in managed or course in reader.courses):
            event.editable = True
            event.start_editable = stage in (Stage.AWAITING, Stage.BOOKED)
            event.extended_props = {"version": version}
        if named := written_times(held.starts_at, held.ends_at):
            event.extended_props = {**(event.extended_props or {}), "times": named}
        events.append(event)
    return events


def _background(
    key: UUID | str, slug: str, times: tuple[str, str], title: str = "", kind: str = "out"
) -> Event:
    """Return an event that colours a robot's background; `times`: begin and end."""
    begins, ends = times
    return Event(
        id=key,
        resource_ids=(slug,),
        start=begins,
        end=ends,
        title=title,
        display="background",
        class_names=(kind,),
    )


def _holiday(holiday: Holiday, slug: str, zone: ZoneInfo) -> Event:
    """Return a holiday of the lab as background event of a robot."""
    lab = zone_of("")
    times = span(day_of(holiday.first_day, lab).starts_at, day_of(holiday.last_day, lab).ends_at, zone)
    return _background(f"{holiday.pk}-{slug}", slug, times, holiday.name, kind="holiday")


def _closed(robot: Robot, policy: Policy, first: date, last: date, zone: ZoneInfo) -> Iterable[Event]:
    """Return the closed hours of each day as background events."""
    if not policy.opening:
        return
    day, lab = first - timedelta(days=1), zone_of("")
    while day <= last:
        whole, opening = day_of(day, lab), opening_of(day, policy.opening, lab)
        closes = [whole.starts_at, *(one.ends_at for one in opening)]
        opens = [*(one.starts_at for one in opening), whole.ends_at]
        for number, (starts, ends) in enumerate(zip(closes, opens, strict=True)):
            if starts < ends:
                key = f"closed-{robot.slug}-{WEEKDAYS[day.weekday()]}-{day}-{number}"
                yield _background(key, robot.slug, span(starts, ends, zone), kind="closed")
        day += timedelta(days=1)
