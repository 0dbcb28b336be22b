"""The demo's course, bookings and past week."""

import datetime as dt
import json

import pytest
from django.core.management import call_command
from django.utils import timezone

from fleet.bookings.models import Booking
from fleet.bookings.schedule import schedule_of
from robots.access.models import Course
from robots.registry.models import Robot
from teleop.models import ControlSession

pytestmark = pytest.mark.django_db


@pytest.fixture
def plan(tmp_path):
    """A file with four students."""
    students = [{"username": name, "password": "a long walk"} for name in ("anna", "ben", "cleo", "dana")]
    path = tmp_path / "plan"
    path.write_text(json.dumps({"students": students}))
    return path


@pytest.mark.parametrize(
    "now",
    [
        dt.datetime(2026, 11, 25, 9, 10, tzinfo=dt.UTC),
        dt.datetime(2026, 11, 29, 22, 40, tzinfo=dt.UTC),
    ],
    ids=["wednesday", "sunday night: the week's quota is used most"],
)
@pytest.mark.parametrize("number", [1, 2, 3, 5])
def test_the_demo_has_a_course_and_a_week_of_use(tiago, plan, number, now, monkeypatch):
    monkeypatch.setattr(timezone, "now", lambda: now)
    robots = [
        Robot.objects.create(
            slug=f"tiago-{one}", name=f"TIAGo {one}", profile=tiago, master_uri=f"http://127.0.0.1:{9 + one}"
        )
        for one in range(number)
    ]
    call_command("seed_demo_week", plan)
    assert Course.objects.get().enrolments.count() == 4
    booked = [one for one in robots if schedule_of(one, timezone.now()).current is not None]
    assert len(booked) == 1
    assert ControlSession.objects.count() > 7 * number
    assert set(Robot.objects.values_list("fence", flat=True)) == {0}  # else the bridges would start stopped
    count = Booking.objects.count()
    call_command("seed_demo_week", plan)
    assert Booking.objects.count() == count
