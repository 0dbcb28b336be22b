"""One day of many robots: who booked and drove, refusals and stops.

Read from sessions, bookings and the audit log.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from datetime import date, datetime, timedelta
from uuid import UUID

from django.urls import reverse
from django.utils.timezone import localtime
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.base import zones
from fleet.base.durations import duration_text
from fleet.bookings.models import Booking, State
from fleet.bookings.selectors import grace_of, held_slot, policies_of, stage_of
from robots.access.selectors import robots_visible_to, roles_of
from robots.registry.models import Robot, Role
from teleop.models import ControlSession

MOST_RECORDS = 3000  # of the day, so that the page is never slow
_LEAST_PERCENT = 0.4  # of the day's width: a shorter mark would be invisible


class Mark(Struct, frozen=True):
    """A mark in the picture of a robot's day; `left` and `width` in percent of the day."""

    kind: str  # "booked", "held", "driven", "refused", "stopped"
    left: str
    width: str
    words: str
    url: str


class Stretch(Struct, frozen=True):
    """One line of a robot's list: a time, and its facts in words."""

    at: datetime
    until: datetime | None  # None: it has not ended, or has no length
    kind: str
    who: str
    facts: list[str]
    url: str


class RobotDay(Struct, frozen=True):
    """One robot's day."""

    robot: Robot
    marks: list[Mark]
    stretches: list[Stretch]


class Hour(Struct, frozen=True):
    """An hour of the clock in the picture."""

    left: str
    text: str
    is_major: bool


class Day(Struct, frozen=True):
    """The day of all robots."""

    day: date
    hours: list[Hour]
    robots: list[RobotDay]
    now: str  # position of the present time; "" on other days
    truncated: bool


def supervised_by(user: User) -> list[Robot]:
    """Return the robots that `user` supervises; staff supervise all."""
    robots = list(robots_visible_to(user))
    roles = roles_of(user, robots)
    return [
        robot for robot in robots if (role := roles.get(robot.id)) is not None and role >= Role.SUPERVISOR
    ]


def day_of(robots: Sequence[Robot], day: date, now: datetime) -> Day:
    """Return what happened with these robots on a day of the viewer's zone, and what is booked."""
    zone = zones.viewers()
    starts, ends = zones.start_of(day, zone), zones.end_of(day, zone)
    ids = [robot.id for robot in robots]
    sessions: dict[UUID, list[ControlSession]] = defaultdict(list)
    held = ControlSession.objects.select_related("user").filter(robot__in=ids, started_at__lt=ends)
    for session in held.exclude(ended_at__lte=starts).order_by("started_at"):
        sessions[session.robot_id].append(session)
    bookings: dict[UUID, list[Booking]] = defaultdict(list)
    booked = Booking.objects.select_related("person", "course").filter(
        robot__in=ids, starts_at__lt=ends, held_until__gt=starts
    )
    for booking in booked.exclude(state__in=[State.CANCELLED, State.OFFERED]).order_by("starts_at"):
        bookings[booking.robot_id].append(booking)
    policies = policies_of(robots)
    records = _records(ids, starts, ends)
    of_robot: dict[UUID | None, list[Record]] = defaultdict(list)
    for record in records:
        of_robot[record.robot_id].append(record)
    scale = _Scale(starts, ends)
    return Day(
        day=day,
        hours=_hours(starts, ends, scale),
        robots=[
            _robot_day(
                robot,
                sessions[robot.id],
                bookings[robot.id],
                of_robot[robot.id],
                scale,
                now,
                grace_of(policies[robot.id]),
            )
            for robot in robots
        ],
        now=scale.place(now) if starts <= now < ends else "",
        truncated=len(records) == MOST_RECORDS,
    )


class _Scale(Struct, frozen=True):
    starts: datetime
    ends: datetime

    def place(self, at: datetime) -> str:
        """Return the position of a moment, in percent of the day."""
        return f"{self._share(at):.2f}%"

    def width(self, begins: datetime, ends: datetime) -> str:
        """Return the width of a period, in percent of the day."""
        return f"{max(self._share(ends) - self._share(begins), _LEAST_PERCENT):.2f}%"

    def _share(self, at: datetime) -> float:
        within = min(max(at, self.starts), self.ends) - self.starts
        return 100.0 * (within / (self.ends - self.starts))


def _hours(starts: datetime, ends: datetime, scale: _Scale) -> list[Hour]:
    """Return the hours that the clock shows: 23 or 25 of them when daylight saving begins or ends."""
    found, at = [], starts
    while at < ends:
        local = localtime(at)
        if local.minute == 0:
            found.append(Hour(scale.place(at), f"{local:%H}", local.hour % 6 == 0))
        at += timedelta(minutes=60 - local.minute)
    return found


def _records(ids: list[UUID], starts: datetime, ends: datetime) -> list[Record]:
    days = (starts.date(), ends.date())
    kinds = ["drive.end", "refusal", "stop.press"]
    found = Record.objects.filter(
        robot_id__in=ids, kind__in=kinds, day__range=days, at__gte=starts, at__lt=ends
    )
    return list(found.select_related("actor").order_by("-pk")[:MOST_RECORDS])[::-1]


def _robot_day(
    robot: Robot,
    sessions: list[ControlSession],
    bookings: list[Booking],
    records: list[Record],
    scale: _Scale,
    now: datetime,
    grace: timedelta,
) -> RobotDay:
    marks, stretches = [], []
    for booking in bookings:
        url = reverse("booking", args=[booking.pk])
        ends_at = held_slot(booking, grace, now).ends_at
        who = booking.lesson_of or str(booking.person)
        words = f"{_clock(booking.starts_at)}–{_clock(ends_at)} {who}"  # noqa: RUF001
        marks.append(
            Mark(
                "booked",
                scale.place(booking.starts_at),
                scale.width(booking.starts_at, ends_at),
                words,
                url,
            )
        )
        facts = [_(stage_of(booking, grace, now).value), *([booking.purpose] if booking.purpose else [])]
        stretches.append(Stretch(booking.starts_at, ends_at, "booked", who, facts, url))
    of_session: dict[UUID | None, list[Record]] = defaultdict(list)
    for record in records:
        of_session[record.session_id].append(record)
    for session in sessions:
        url = reverse("control-session", args=[session.pk])
        until, own = session.ended_at or now, of_session.pop(session.pk, [])
        words = f"{_clock(session.started_at)}–{_clock(until)} {session.user}"  # noqa: RUF001
        marks.append(
            Mark("held", scale.place(session.started_at), scale.width(session.started_at, until), words, url)
        )
        marks += [_mark(record, scale, url) for record in own]
        stretches.append(
            Stretch(session.started_at, session.ended_at, "held", str(session.user), _facts(own), url)
        )
    for record in (record for others in of_session.values() for record in others):
        url = reverse("control-session", args=[record.session_id]) if record.session_id else ""
        marks.append(_mark(record, scale, url))
        if record.kind != "drive.end":
            kind = "stopped" if record.kind == "stop.press" else "refused"
            stretches.append(Stretch(record.at, None, kind, record.actor_name, [], url))
    return RobotDay(robot, marks, sorted(stretches, key=lambda one: one.at))


def _mark(record: Record, scale: _Scale, url: str) -> Mark:
    if record.kind == "drive.end":
        begins = record.at - timedelta(seconds=float(record.parameters.get("duration_s") or 0))
        return Mark("driven", scale.place(begins), scale.width(begins, record.at), _("driven"), url)
    kind, words = ("stopped", _("stopped")) if record.kind == "stop.press" else ("refused", _("refused"))
    return Mark(kind, scale.place(record.at), "", f"{_clock(record.at)} {words}", url)


def _facts(records: list[Record]) -> list[str]:
    drives = [record.parameters for record in records if record.kind == "drive.end"]
    driven_s = sum(float(drive.get("duration_s") or 0) for drive in drives)
    metres = sum(float(drive.get("distance_m") or 0) for drive in drives)
    refused, stopped = _count_events(records, "refusal"), _count_events(records, "stop.press")
    facts = []
    if drives:
        facts.append(
            _("drove %(time)s, %(metres).0f m") % {"time": duration_text(driven_s), "metres": metres}
        )
    if refused:
        facts.append(ngettext("refused once", "refused %(times)d times", refused) % {"times": refused})
    if stopped:
        facts.append(ngettext("stopped once", "stopped %(times)d times", stopped) % {"times": stopped})
    return facts


def _count_events(records: list[Record], kind: str) -> int:
    """Count events of a kind: one record may count several."""
    return sum(int(record.parameters.get("times") or 1) for record in records if record.kind == kind)


def _clock(at: datetime) -> str:
    return f"{localtime(at):%H:%M}"
