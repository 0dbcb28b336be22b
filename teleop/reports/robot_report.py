"""The use of a robot over some days: hours, distance, times of day, faults. Read from the audit log.

Each figure is one query for one kind of records of this robot. An index makes it fast even in a long log.
"""

from __future__ import annotations

from datetime import UTC, date, datetime, time, timedelta
from typing import Any

from django.db.models import Count, F, FloatField, Max, OuterRef, QuerySet, Subquery, Sum
from django.db.models.fields.json import KeyTextTransform
from django.db.models.functions import Cast, Coalesce, ExtractHour, TruncDate
from msgspec import Struct

from fleet.audit.models import Content, Record
from fleet.audit.reading import wording
from fleet.audit.reading.listing import Selection, Wanted
from fleet.base import zones
from fleet.base.durations import duration_text
from robots.registry.models import Robot

PERIODS_DAYS = (7, 30, 90, 365)
FAULTS = 10  # the newest faults, and as many parts that got worse
CHANGES = 100  # records of health that are searched for these parts
REASONS = 10  # the most frequent reasons


class Reason(Struct, frozen=True):
    """A reason why the gate intervened."""

    code: str
    times: int
    words: str  # of the last time; empty if they have expired
    at: datetime  # last time

    @property
    def words_of_code(self) -> str:
        return wording.outcome(self.code)


class Fault(Struct, frozen=True):
    """A fault of the robot, or a part of it that got worse."""

    at: datetime
    what: str


class Day(Struct, frozen=True):
    """Driving on one day."""

    day: date
    hours: float
    metres: float

    @property
    def driven(self) -> str:
        """Time driven, as h:mm:ss."""
        return duration_text(self.hours * 3600.0)


class Usage(Struct, frozen=True):
    """Hours driven: on each day, in each hour of the day, on each weekday (Monday first), in the viewer's zone."""

    days: list[Day]
    hours: list[float]
    weekdays: list[float]


class RobotReport(Struct, frozen=True):
    """The content of the page."""

    since: date
    drives: int
    driven_h: float
    distance_m: float
    interventions: int
    stops: int
    use: Usage
    reasons: list[Reason]
    faults: list[Fault]

    @property
    def driven(self) -> str:
        """Time driven, as h:mm:ss."""
        return duration_text(self.driven_h * 3600.0)

    @property
    def interventions_per_hour(self) -> float | None:
        """Gate interventions per hour of driving; None below an hour, which says little."""
        return self.interventions / self.driven_h if self.driven_h >= 1.0 else None


def report_of(robot: Robot, days: int, now: datetime) -> RobotReport:
    """Report the last `days`, including today."""
    today = zones.day_of(now)
    since = today - timedelta(days=days - 1)
    driven = _driven(robot, since, today)
    reasons = _interventions(robot, since, today)
    use = _use(driven, since, days)
    return RobotReport(
        since=since,
        drives=sum(row["drives"] for row in driven),
        driven_h=sum(use.hours),
        distance_m=sum(day.metres for day in use.days),
        interventions=sum(row["times"] for row in reasons),
        stops=_stops(robot, since, today),
        use=use,
        reasons=_reasons(reasons[:REASONS]),
        faults=_faults(robot, since, today),
    )


def _of_days(robot: Robot, since: date, until: date) -> QuerySet[Record]:
    """Select the records of these days, without records of the future: a clock may have been ahead."""
    zone = zones.viewers()
    starts, ends = zones.start_of(since, zone), zones.end_of(until, zone)
    records = Record.objects.filter(robot_id=robot.pk, day__range=(starts.date(), ends.date()))
    return records.filter(at__gte=starts, at__lt=ends)


def _stops(robot: Robot, since: date, until: date) -> int:
    """Count the presses of stop: one record may count several presses."""
    pressed = _of_days(robot, since, until).filter(kind="stop.press", of=None)
    times = Coalesce(_number("times", "parameters"), 1.0)
    return int(pressed.aggregate(pressed=Sum(times))["pressed"] or 0)


def _driven(robot: Robot, since: date, until: date) -> list[Any]:
    """Return for each hour in which drives ended: their number, seconds and metres."""
    ended = _of_days(robot, since, until).filter(kind="drive.end")
    return list(
        ended.order_by()
        .values(on=TruncDate("at"), hour=ExtractHour("at"))
        .annotate(drives=Count("pk"), seconds=Sum(figure("duration_s")), metres=Sum(figure("distance_m")))
    )


def figure(name: str) -> Coalesce:
    """Select a figure of a drive. Until November 2026 it was stored with the path: slow to read, and it may expire."""
    stored_with_path = Content.objects.filter(pk=OuterRef("pk")).values(figure=_number(name, "data"))
    return Coalesce(_number(name, "parameters"), Subquery(stored_with_path))


def _number(name: str, column: str) -> Cast:
    return Cast(KeyTextTransform(name, column), FloatField())


def _use(driven: list[Any], since: date, days: int) -> Usage:
    period = [since + timedelta(days=number) for number in range(days)]
    on_day, metres = dict.fromkeys(period, 0.0), dict.fromkeys(period, 0.0)
    hours, weekdays = [0.0] * 24, [0.0] * 7
    for row in driven:
        day, lasted_h = row["on"], (row["seconds"] or 0.0) / 3600.0
        on_day[day] += lasted_h
        metres[day] += row["metres"] or 0.0
        hours[row["hour"]] += lasted_h
        weekdays[day.weekday()] += lasted_h
    return Usage([Day(day, on_day[day], metres[day]) for day in period], hours, weekdays)


def _interventions(robot: Robot, since: date, until: date) -> list[Any]:
    """Return each reason of the gate, most frequent first: code, times, number of the newest record."""
    begun = _of_days(robot, since, until).filter(kind="gate.begin")
    return list(
        begun.order_by()
        .values(code=F("outcome"))
        .annotate(times=Count("pk"), newest=Max("pk"))
        .order_by("-times")
    )


def _reasons(rows: list[Any]) -> list[Reason]:
    newest = Record.objects.select_related("content").in_bulk([row["newest"] for row in rows])
    return [
        Reason(row["code"], row["times"], wording.worded(record.details).get("words", ""), record.at)
        for row in rows
        if (record := newest.get(row["newest"]))
    ]


def _faults(robot: Robot, since: date, until: date) -> list[Fault]:
    """Return the newest faults, and for each part only the last time it got worse.

    So a part that often changes between good and bad does not hide the others.
    """
    wanted = Wanted(robot=robot.pk, since=since, until=until, zone=zones.viewers().key)
    found = [row.record for row in Selection(wanted, ["fault"]).page(size=FAULTS).rows]
    last: dict[str, Record] = {}
    for row in Selection(wanted, ["health.worse"]).page(size=CHANGES).rows:
        last.setdefault(row.record.parameters["part"], row.record)
    found += [*last.values()][:FAULTS]
    found.sort(key=lambda record: -record.pk)
    return [Fault(record.at, _what(record)) for record in found]


def _what(record: Record) -> str:
    said = wording.subject(record) or wording.outcome(record.outcome)
    return said or "{part}: {to}".format_map(record.parameters)  # a part's health, if the words have expired


def day_start_s(day: date) -> int:
    """Return the start of the day in UTC, in seconds since 1970: the same number in every time zone."""
    return int(datetime.combine(day, time(), UTC).timestamp())
