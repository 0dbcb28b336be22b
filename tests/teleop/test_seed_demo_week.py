"""The demo's course, bookings and past week."""

import json

import pytest
from django.core.management import call_command
from django.utils import timezone

from fleet.bookings.models import Booking
from fleet.bookings.selectors import schedule_of
from robots.access.models import Course
from robots.registry.models import Robot
from teleop.models import ControlSession

pytestmark = pytest.mark.django_db


def test_the_demo_has_a_course_and_a_week_of_use(robot, other_robot, tiago, tmp_path):
    third = Robot.objects.create(
        slug="tiago-3", name="TIAGo 3", profile=tiago, master_uri="http://127.0.0.1:9"
    )
    plan = tmp_path / "plan"
    students = [{"username": name, "password": "a long walk"} for name in ("anna", "ben", "cleo", "dana")]
    plan.write_text(json.dumps({"students": students}))
    call_command("seed_demo_week", plan)
    assert Course.objects.get().enrolments.count() == 4
    assert {schedule_of(one, timezone.now()).current is None for one in (robot, other_robot, third)} == {
        True,
        False,
    }
    assert ControlSession.objects.count() > 20
    assert set(Robot.objects.values_list("fence", flat=True)) == {0}  # else their bridges would start stopped
    count = Booking.objects.count()
    call_command("seed_demo_week", plan)
    assert Booking.objects.count() == count
