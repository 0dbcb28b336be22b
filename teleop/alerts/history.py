"""The last 90 days of robots, and of the console's parts, from their alerts."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import date, datetime, timedelta

from django.utils import timezone
from django.utils.timezone import localtime
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.base.formats.sentences import in_words
from robots.access.selectors import lab_date
from robots.registry.models import Robot
from teleop.alerts.watch import KEPT
from teleop.models import Alert

DAYS = KEPT.days
_LEVELS_MIN = (1, 60, 480)  # away for longer than this: level 1, 2, 3


class Day(Struct, frozen=True):
    """One day of a line. `level`: 0 (nothing) to 3 (away for most of a working day)."""

    day: date
    level: int
    words: str


class Line(Struct, frozen=True):
    """A robot, or the console's own parts: now, and day by day."""

    name: str
    robot: Robot | None
    now: list[str]  # sentences of open alerts
    days: list[Day]
    share: float  # percent of the 90 days without an alert


def lines(robots: Collection[Robot], *, console: bool) -> list[Line]:
    """Return a line for each robot, after that of the console if asked for. One query."""
    now = timezone.now()
    found = list(Alert.objects.select_related("robot").filter(began_at__lte=now))
    by_robot: dict[object, list[Alert]] = {}
    for alert in found:
        by_robot.setdefault(alert.robot_id, []).append(alert)
    own = [_line(_("Console"), None, by_robot.get(None, []), now)] if console else []
    return own + [_line(one.name, one, by_robot.get(one.pk, []), now) for one in robots]


def _line(name: str, robot: Robot | None, alerts: list[Alert], now: datetime) -> Line:
    spans = list(_joined((max(one.began_at, now - KEPT), one.over_at or now) for one in alerts))
    away = sum((ends - begins for begins, ends in spans), timedelta())
    today = lab_date()
    days = [_day(today - timedelta(days=back), spans) for back in range(DAYS - 1, -1, -1)]
    open_ones = [in_words(one.words) for one in alerts if one.over_at is None]
    return Line(name, robot, open_ones, days, 100.0 * (1.0 - away / KEPT))


def _joined(spans: Iterator[tuple[datetime, datetime]]) -> Iterator[tuple[datetime, datetime]]:
    """Join spans that overlap: two alerts of one robot at once are one time away."""
    current: tuple[datetime, datetime] | None = None
    for begins, ends in sorted(spans):
        if current is not None and begins <= current[1]:
            current = current[0], max(current[1], ends)
            continue
        if current is not None:
            yield current
        current = begins, ends
    if current is not None:
        yield current


def _day(day: date, spans: list[tuple[datetime, datetime]]) -> Day:
    zone = timezone.get_default_timezone()
    first = datetime.combine(day, datetime.min.time(), zone)
    last = datetime.combine(day + timedelta(days=1), datetime.min.time(), zone)
    away = sum(
        (max(min(ends, last) - max(begins, first), timedelta()) for begins, ends in spans), timedelta()
    )
    minutes = round(away / timedelta(minutes=1))
    level = sum(minutes >= least for least in _LEVELS_MIN)
    shown = f"{localtime(first):%Y-%m-%d}"
    return Day(day, level, _("%(day)s: %(minutes)d min") % {"day": shown, "minutes": minutes})
