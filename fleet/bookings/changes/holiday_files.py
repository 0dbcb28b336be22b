"""Reads holidays from a calendar file (iCalendar, .ics), with entries that return by a rule."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date, datetime, time, timedelta
from itertools import islice
from typing import Any

from dateutil.rrule import rrulestr
from django.core.exceptions import ValidationError
from django.utils.translation import gettext as _
from icalendar import Calendar

from fleet.base.zones import zone_of
from fleet.bookings.changes.holidays import MOST, Entry
from robots.access.selectors import lab_date

MOST_BYTES = 1_000_000  # of a file
YEARS = 2  # how far ahead an entry that returns is read, to the end of that year
DAY = timedelta(days=1)
READABLE = ("DAILY", "WEEKLY", "MONTHLY", "YEARLY")


class RuleError(Exception):
    """A rule by which an entry returns cannot be read."""


def read_file(data: bytes) -> tuple[list[Entry], list[str]]:
    """Return the days of a calendar file that are not over, and the names of entries that cannot be taken.

    Raises `ValidationError`.
    """
    if len(data) > MOST_BYTES:
        raise ValidationError(_("The file is larger than 1 MB."))
    found: set[Entry] = set()
    left: list[str] = []
    try:
        events = Calendar.from_ical(data).walk("VEVENT")
        moved = {
            (str(one.get("UID")), _day(one["RECURRENCE-ID"].dt)) for one in events if "RECURRENCE-ID" in one
        }
        for event in events:
            try:
                found.update(_entries(event, moved))
            except RuleError:
                left.append(_name(event) or _("without a name"))
    except (ValueError, KeyError, IndexError, AttributeError, TypeError, OverflowError) as error:
        raise ValidationError(_("This is no calendar file (.ics) that can be read.")) from error
    if len(found) > MOST:
        raise ValidationError(_("The file has more than %(most)d days to come.") % {"most": MOST})
    return sorted(found), left


def last_read() -> date:
    """Return the last day on which an entry that returns is read."""
    return date(lab_date().year + YEARS, 12, 31)


def _name(event: Calendar) -> str:
    return str(event.get("SUMMARY", "")).strip()[:80]


def _entries(event: Calendar, moved: set[tuple[str, date]]) -> Iterator[Entry]:
    """Yield an event of a file on each of its days. `moved`: dates of a series for which the file has another event."""
    if str(event.get("STATUS", "")).upper() == "CANCELLED":
        return
    if not (name := _name(event)):
        raise RuleError
    length = max(_day(event.end, is_end=True) - _day(event.start), timedelta(0))
    besides = {_day(one) for one in event.exdates}
    if "RECURRENCE-ID" not in event:
        besides |= {day for uid, day in moved if uid == str(event.get("UID"))}
    for day in {*_days(event), *(_day(start) for start, _end in event.rdates)} - besides:
        if day + length >= lab_date():
            yield Entry(day, day + length, name)


def _days(event: Calendar) -> Iterator[date]:
    """Yield the lab's days on which an event begins. Raises `RuleError`."""
    start = event.start
    if not event.rrules and all(name != "RRULE" for name, _text in event.errors):
        yield _day(start)
        return
    if len(event.rrules) != 1:
        raise RuleError
    # In the wall-clock time of the event, without its zone, because a rule counts by it
    zone = start.tzinfo if isinstance(start, datetime) else None
    begin = start.replace(tzinfo=None) if isinstance(start, datetime) else datetime.combine(start, time.min)
    for moment in _moments(event.rrules[0], begin, zone):
        yield _day(moment.replace(tzinfo=zone) if isinstance(start, datetime) else moment.date())


def _moments(rule: Any, begin: datetime, zone: Any) -> Iterator[datetime]:
    """Yield the moments of a rule until `last_read`."""
    values = {name.upper(): given for name, given in rule.items()}
    if values.get("FREQ", [""])[0] not in READABLE or min(values.get("INTERVAL", [1])) < 1:
        raise RuleError
    count, until = (values.pop(name, [None])[0] for name in ("COUNT", "UNTIL"))
    ends = datetime.combine(last_read(), time.max)
    if isinstance(until, datetime):
        ends = min(ends, (until.astimezone(zone) if until.tzinfo and zone else until).replace(tzinfo=None))
    elif until is not None:
        ends = min(ends, datetime.combine(until, time.max))
    # A rule without an end would be searched to the year 9999
    text = type(rule)(values).to_ical().decode() + f";UNTIL={ends:%Y%m%dT%H%M%S}"
    try:
        yield from islice(rrulestr(text, dtstart=begin), count)
    except ValueError as error:
        raise RuleError from error


def _day(at: date | datetime, *, is_end: bool = False) -> date:
    """Return the lab's day of a moment. A file's end is the day, or the moment, after the last."""
    if not isinstance(at, datetime):
        return at - DAY if is_end else at
    lab = zone_of("")
    moment = at.astimezone(lab) if at.tzinfo else at.replace(tzinfo=lab)
    return (moment - datetime.resolution if is_end else moment).date()
