"""The demo's course, bookings and past week."""

import json

import pytest
from django.core.management import call_command
from django.utils import timezone

from fleet.bookings.models import Booking
from fleet.bookings.selectors import schedule_of
from robots.access.models import Course
from teleop.models import ControlSession

pytestmark = pytest.mark.django_db


def test_the_demo_has_a_course_and_a_week_of_use(robot, other_robot, tmp_path):
    plan = tmp_path / "plan"
    students = [{"username": name, "password": "a long walk"} for name in ("anna", "ben", "cleo", "dana")]
    plan.write_text(json.dumps({"students": students}))
    call_command("seed_demo_week", plan)
    assert Course.objects.get().enrolments.count() == 4
    assert {schedule_of(one, timezone.now()).current is None for one in (robot, other_robot)} == {
        True,
        False,
    }
    assert ControlSession.objects.count() > 20
    count = Booking.objects.count()
    call_command("seed_demo_week", plan)
    assert Booking.objects.count() == count
