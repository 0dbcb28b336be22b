"""One day of all robots, for supervisors and staff."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta

import pytest
from django.test import Client
from django.utils import timezone as django_timezone

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.bookings.models import Booking
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.reports import today

NOON = datetime(2026, 3, 29, 12, tzinfo=UTC)


@pytest.fixture
def session(robot: Robot, operator: User, monkeypatch: pytest.MonkeyPatch) -> ControlSession:
    ended = NOON + timedelta(minutes=30)
    made = ControlSession.objects.create(robot=robot, user=operator, fence=1, started_at=NOON, ended_at=ended)
    monkeypatch.setattr(django_timezone, "now", lambda: NOON + timedelta(minutes=10))
    facts = {"robot_id": robot.id, "robot_name": robot.name, "session_id": made.pk}
    record("drive.end", actor=operator, parameters={"duration_s": 60.0, "distance_m": 12.0}, **facts)  # type: ignore[arg-type]
    record("refusal", actor=operator, outcome="too_old", parameters={"times": 3}, **facts)  # type: ignore[arg-type]
    record("stop.press", actor=operator, **facts)  # type: ignore[arg-type]
    return made


def test_a_day_has_its_sessions_drives_refusals_stops(robot: Robot, session: ControlSession) -> None:
    with django_timezone.override("Europe/Madrid"):
        day = today.day_of([robot], date(2026, 3, 29), NOON)
        assert len(day.hours) == 23  # daylight saving begins
        [own] = day.robots
        assert [mark.kind for mark in own.marks] == ["held", "driven", "refused", "stopped"]
        [stretch] = own.stretches
        assert stretch.facts == ["drove 0:01:00, 12 m", "refused 3 times", "stopped once"]
        assert stretch.url == f"/sessions/{session.pk}/"
        assert today.day_of([robot], date(2026, 3, 30), NOON).robots[0].stretches == []
        assert len(today.day_of([robot], date(2026, 10, 25), NOON).hours) == 25


def test_a_slot_that_nobody_used_ends_with_its_grace_time(robot: Robot, operator: User) -> None:
    ends = NOON + timedelta(hours=1)
    Booking.objects.create(
        robot=robot, person=operator, starts_at=NOON, ends_at=ends, held_until=ends, made_at=NOON
    )
    for minutes, until, words in ((5, 60, "not used yet"), (20, 15, "not used")):
        [own] = today.day_of([robot], date(2026, 3, 29), NOON + timedelta(minutes=minutes)).robots
        [stretch] = own.stretches
        assert (stretch.until, stretch.facts) == (NOON + timedelta(minutes=until), [words])


def test_supervisors_see_their_robots_and_nobody_else_any(
    robot: Robot, other_robot: Robot, supervisor: User, operator: User, staff: User, session: ControlSession
) -> None:
    def page(person: User, asked: str = "?day=2026-03-29") -> tuple[int, str]:
        client = Client()
        client.force_login(person)
        answer = client.get(f"/today/{asked}")
        return answer.status_code, answer.content.decode()

    status, text = page(supervisor)
    assert (status, "Olga Operator" in text, other_robot.name in text) == (200, True, False)
    assert other_robot.name in page(staff)[1]
    assert page(operator)[0] == 403
    assert page(staff, "?day=yesterday")[0] == 400
    assert page(staff, "?day=2026-02-31")[0] == 400
    assert page(staff, "?day=9999-12-31")[0] == 400
    assert page(staff, "?day=1970-01-01")[0] == 200
