"""Time zones: moments are stored in UTC and shown in the person's own zone, or in the lab's.

During a request, Django's current zone is that of the person (`fleet.accounts.middleware.ViewersChoices`).
"""

from __future__ import annotations

from datetime import UTC, date, datetime, time, timedelta
from functools import cache
from zoneinfo import ZoneInfo, available_timezones

from django.conf import settings
from django.utils.timezone import get_current_timezone_name, localtime

UTC_ZONE = "UTC"
_REGIONS = (
    "Africa",
    "America",
    "Antarctica",
    "Arctic",
    "Asia",
    "Atlantic",
    "Australia",
    "Europe",
    "Indian",
    "Pacific",
)


@cache
def names() -> frozenset[str]:
    """Return the names of the zones that this computer has, such as "Europe/Madrid"."""
    return frozenset(available_timezones())


def zone_of(name: str) -> ZoneInfo:
    """Return the zone with this name; the lab's if it is blank or unknown."""
    return ZoneInfo(name if name in names() else settings.TIME_ZONE)


def viewers() -> ZoneInfo:
    """Return the zone of the person whose request runs."""
    return ZoneInfo(get_current_timezone_name())


def day_of(moment: datetime, zone: ZoneInfo | None = None) -> date:
    """Return the day of a moment in a zone; without a zone, in the viewer's."""
    return localtime(moment, zone or viewers()).date()


def start_of(day: date, zone: ZoneInfo) -> datetime:
    """Return the first moment of a day, in UTC. If the clock skips midnight, the day begins after the gap."""
    try:
        return datetime.combine(day, time(), zone).astimezone(UTC)
    except OverflowError:  # the first or the last day of the calendar
        return datetime.combine(day, time(), UTC)


def end_of(day: date, zone: ZoneInfo) -> datetime:
    """Return the first moment after a day, in UTC: 23, 24 or 25 hours after its start."""
    if day == date.max:
        return datetime.max.replace(tzinfo=UTC)
    return start_of(day + timedelta(days=1), zone)


def choices() -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the zones to choose from, by region: name, and text such as "Madrid"."""
    regions: dict[str, list[tuple[str, str]]] = {region: [] for region in _REGIONS}
    for name in sorted(names()):
        region, _slash, place = name.partition("/")
        if region in regions and place:
            regions[region].append((name, place.replace("_", " ").replace("/", ", ")))
    return [(region, found) for region, found in regions.items() if found]
