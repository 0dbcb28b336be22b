"""Holidays of the lab: add, remove, and read them from a calendar file (iCalendar, .ics)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import date, datetime, timedelta
from typing import Any
from uuid import UUID

from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils import timezone
from django.utils.translation import gettext as _
from icalendar import Calendar
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.base.zones import zone_of
from fleet.bookings.losses.weighing import hours_watched
from fleet.bookings.models import Holiday
from fleet.bookings.services import robots_locked
from robots.access.selectors import lab_date
from robots.registry.models import Robot

MOST_BYTES = 1_000_000  # of a file
MOST = 500  # entries of a file
YEARS = 2  # how far ahead a yearly entry is read
DAY = timedelta(days=1)


class Entry(Struct, frozen=True, order=True):
    """A holiday that is not stored yet."""

    first_day: date
    last_day: date
    name: str


@transaction.atomic
def holidays_add(entries: Iterable[Entry], *, actor: User) -> list[Holiday]:
    """Add holidays; leave out those that are stored already. Raises `ValidationError`.

    All robots are locked: nobody may book these days meanwhile.
    """
    made, robots, now = [], list(Robot.objects.all()), timezone.now()
    with robots_locked([robot.pk for robot in robots], now), hours_watched(robots, now):
        for one in new_among(entries):
            holiday = Holiday(name=one.name, first_day=one.first_day, last_day=one.last_day)
            holiday.full_clean()
            holiday.save()
            record("holiday.add", actor=actor, **_facts(holiday))
            made.append(holiday)
    return made


@transaction.atomic
def holiday_remove(*, holiday_id: UUID, actor: User) -> None:
    """Remove a holiday, if it is still there: people who wait for its days get them."""
    with robots_locked(Robot.objects.values_list("pk", flat=True), timezone.now()):
        for holiday in Holiday.objects.filter(pk=holiday_id):
            record("holiday.remove", actor=actor, **_facts(holiday))
            holiday.delete()


def new_among(entries: Iterable[Entry]) -> list[Entry]:
    """Return the entries that are not stored, each once, in order."""
    stored = set(Holiday.objects.values_list("first_day", "name"))
    return sorted(one for one in set(entries) if (one.first_day, one.name) not in stored)


def _facts(holiday: Holiday) -> dict[str, Any]:
    days = {"from": holiday.first_day.isoformat(), "to": holiday.last_day.isoformat()}
    return {"parameters": days, "private": {"name": holiday.name}}


def read_file(data: bytes) -> list[Entry]:
    """Return the days of a calendar file that are not over. Raises `ValidationError`."""
    if len(data) > MOST_BYTES:
        raise ValidationError(_("The file is larger than 1 MB."))
    try:
        events = Calendar.from_ical(data).walk("VEVENT")
        found = [entry for event in events for entry in _entries(event)]
    except (ValueError, KeyError, IndexError, AttributeError, TypeError, OverflowError) as error:
        raise ValidationError(_("This is no calendar file (.ics) that can be read.")) from error
    if len(found) > MOST:
        raise ValidationError(_("The file has more than %(most)d days to come.") % {"most": MOST})
    return sorted(set(found))


def _entries(event: Calendar) -> Iterator[Entry]:
    """Yield an event of a file; one that returns each year, for `YEARS` years."""
    name = str(event.get("SUMMARY", "")).strip()[:80]
    if not name or str(event.get("STATUS", "")).upper() == "CANCELLED":
        return
    first, end = _day(event.start), _day(event.end, is_end=True)
    length = max(end - first, timedelta(0))
    today = lab_date()
    for day in _each_year(first, today) if _is_yearly(event) else [first]:
        if day + length >= today:
            yield Entry(day, day + length, name)


def _day(at: date | datetime, *, is_end: bool = False) -> date:
    """Return the lab's day of a moment. A file's end is the day, or the moment, after the last."""
    if not isinstance(at, datetime):
        return at - DAY if is_end else at
    lab = zone_of("")
    moment = at.astimezone(lab) if at.tzinfo else at.replace(tzinfo=lab)
    return (moment - datetime.resolution if is_end else moment).date()


def _is_yearly(event: Calendar) -> bool:
    """Return whether an event returns on the same day each year. Of other rules, only the first day counts."""
    rule = event.get("RRULE") or {}
    others = {name.upper() for name in rule} - {"FREQ", "INTERVAL", "BYMONTH", "BYMONTHDAY", "WKST"}
    return rule.get("FREQ") == ["YEARLY"] and not others and rule.get("INTERVAL", [1]) == [1]


def _each_year(first: date, today: date) -> Iterator[date]:
    for year in range(max(first.year, today.year - 1), today.year + YEARS + 1):
        if (first.month, first.day) != (2, 29):
            yield first.replace(year=year)
