"""Pages show times in the person's time zone, exports beside UTC; also on the days when clocks change."""

from __future__ import annotations

import csv
import io
from datetime import UTC, date, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from asgiref.sync import async_to_sync
from django.core.exceptions import ImproperlyConfigured
from django.test import Client
from django.utils import timezone as django_timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.base import environment, zones
from fleet.base.environment import Environment
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.reports import robot_report

MADRID = ZoneInfo("Europe/Madrid")
SPRING, AUTUMN = date(2026, 3, 29), date(2026, 10, 25)


def test_an_unknown_zone_stops_the_start_with_its_name() -> None:
    assert environment.time_zone(Environment({})) == "UTC"
    assert environment.time_zone(Environment({"FLEET_TIME_ZONE": "Europe/Madrid"})) == "Europe/Madrid"
    for wrong in ("Madrid", "../etc/passwd", "Europe/Nowhere"):
        with pytest.raises(ImproperlyConfigured, match=r"^FLEET_TIME_ZONE"):
            environment.time_zone(Environment({"FLEET_TIME_ZONE": wrong}))


@pytest.mark.parametrize(("day", "hours"), [(SPRING, 23), (AUTUMN, 25), (date(2026, 6, 1), 24)])
def test_a_day_has_as_many_hours_as_its_clock(day: date, hours: int) -> None:
    starts, ends = zones.start_of(day, MADRID), zones.end_of(day, MADRID)
    assert (ends - starts).total_seconds() == hours * 3600
    assert zones.day_of(starts, MADRID) == day


def test_own_zone_is_chosen_shown_and_recorded(client: Client, operator: User, robot: Robot) -> None:
    client.force_login(operator)
    at = datetime(2026, 3, 29, 0, 30, tzinfo=UTC)
    ended = at.replace(hour=1)
    session = ControlSession.objects.create(
        robot=robot, user=operator, fence=1, started_at=at, ended_at=ended
    )
    assert client.post("/accounts/settings/", {"time_zone": "Europe/Nowhere"}).status_code == 200
    answer = client.post("/accounts/settings/", {"time_zone": "Europe/Madrid"}, follow=True)
    page = answer.content.decode()
    assert 'data-zone="Europe/Madrid"' in page
    assert Record.objects.filter(kind="account.change").latest("pk").parameters["changes"] == [
        {"field": "time_zone"}
    ]
    page = client.get(f"/sessions/{session.pk}/").content.decode()
    assert "01:30:00" in page  # before the clock skips an hour
    assert "03:30:00 CEST" in page  # after it
    assert django_timezone.get_current_timezone_name() == "UTC"


def test_days_of_the_log_are_those_of_the_viewer(client: Client, staff: User) -> None:
    staff.time_zone = "Pacific/Kiritimati"  # UTC+14
    staff.save()
    client.force_login(staff)
    at = Record.objects.latest("pk").at.astimezone(ZoneInfo("Pacific/Kiritimati"))
    time, here = f"{at:%H:%M:%S}</time>", at.date()
    assert time in _log(client, {"since": here, "until": here})
    assert time not in _log(client, {"until": here - timedelta(days=1)})
    assert time not in _log(client, {"since": here + timedelta(days=1)})


def _log(client: Client, asked: dict[str, object]) -> str:
    return client.get("/admin/audit/record/", asked).content.decode()


def test_exports_have_local_times_beside_utc(client: Client, staff: User) -> None:
    staff.time_zone = "Asia/Kolkata"
    staff.save()
    client.force_login(staff)
    answer = client.post("/admin/audit/record/export/", {"format": "csv"})
    text = async_to_sync(_read)(answer).decode("utf-8-sig")
    assert "+05:30" in text
    for row in csv.DictReader(io.StringIO(text)):
        utc, local = (datetime.fromisoformat(row[name]) for name in ("time_utc", "time_local"))
        assert utc == local
        assert local.isoformat().endswith("+05:30")
        assert utc.isoformat().endswith("+00:00")


def test_a_robots_report_counts_the_viewers_days(robot: Robot) -> None:
    now = datetime(2026, 10, 25, 12, tzinfo=UTC)
    with django_timezone.override("Europe/Madrid"):
        report = robot_report.report_of(robot, 7, now)
    assert [day.day for day in report.use.days][-1] == AUTUMN
    assert report.since == date(2026, 10, 19)


async def _read(answer: Any) -> bytes:
    return b"".join([piece async for piece in answer.streaming_content])
