"""Changes of bookings at the same moment, on several robots. Run on SQLite and, with FLEET_DATABASE_URL, PostgreSQL."""

import threading
from datetime import UTC, datetime, timedelta

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.urls import reverse

from fleet.bookings.changes.policy_changes import POLICY_FIELDS, policy_set
from fleet.bookings.messages import notifications
from fleet.bookings.models import Booking, Policy
from fleet.bookings.pages import views
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make
from fleet.bookings.shared_facts import in_turn
from robots.access.models import Course, Enrolment
from robots.access.services import role_set
from robots.registry.models import Robot, Role
from tests.bookings.test_pages import JSON, fields

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)
SLOT = Slot(NOW + timedelta(hours=1), NOW + timedelta(hours=2))


@pytest.fixture
def robots(tiago):
    return [
        Robot.objects.create(
            slug=f"r{number}", name=f"R{number}", profile=tiago, master_uri="http://127.0.0.1:9"
        )
        for number in range(6)
    ]


def all_at_once(steps):
    """Run each step in a thread of its own; return their errors."""
    errors = []
    begin = threading.Barrier(len(steps))

    def run(step):
        begin.wait()
        try:
            step()
        except Exception as error:  # noqa: BLE001  # the test checks them
            errors.append(error)
        finally:
            connection.close()

    threads = [threading.Thread(target=run, args=[step]) for step in steps]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return errors


def codes(errors):
    assert all(isinstance(error, BookingRefused) for error in errors), errors
    return {refusal.code for error in errors for refusal in error.refusals}


def test_a_quota_holds_over_several_robots(robots, stranger):
    Policy.objects.create(at_once=1, robots_at_once=len(robots))
    for robot in robots:
        role_set(robot=robot, user=stranger, role=Role.OPERATOR, actor=None)
    errors = all_at_once(
        [
            lambda robot=robot: booking_make(robot=robot, person=stranger, slot=SLOT, now=NOW)
            for robot in robots
        ]
    )
    assert codes(errors) == {"quota_open"}
    assert Booking.objects.count() == 1


def test_there_is_one_policy_for_all_robots(staff):
    policy = Policy()
    values = {name: getattr(policy, name) for name in POLICY_FIELDS}
    errors = all_at_once([lambda: policy_set(values=values, actor=staff)] * 6)
    assert errors == []
    assert Policy.objects.count() == 1


def test_a_courses_common_quota_holds_over_several_robots(robots, django_user_model):
    days = {"starts_on": NOW.date(), "ends_on": NOW.date() + timedelta(days=30)}
    course = Course.objects.create(name="HRI", slug="hri", role=Role.OPERATOR, course_week_min=60, **days)
    course.robots.set(robots)
    people = [django_user_model.objects.create_user(f"s{number}") for number in range(len(robots))]
    for person in people:
        Enrolment.objects.create(course=course, person=person)
    errors = all_at_once(
        [
            lambda robot=robot, person=person: booking_make(robot=robot, person=person, slot=SLOT, now=NOW)
            for robot, person in zip(robots, people, strict=True)
        ]
    )
    assert codes(errors) == {"quota_common_week"}
    assert Booking.objects.count() == 1


def test_housekeeping_processes_at_once_send_one_reminder(robot, operator, mailoutbox):
    operator.email = "olga@example.org"
    operator.save()
    booking_make(robot=robot, person=operator, slot=SLOT, now=SLOT.starts_at - timedelta(hours=3))
    assert all_at_once([lambda: notifications.write_reminders(NOW)] * 4) == []
    assert all_at_once([lambda: notifications.send_notifications(NOW)] * 4) == []
    assert [mail.subject for mail in mailoutbox] == ["TIAGo 1 is yours soon"]


CLIENTS = 50


def test_of_fifty_after_one_slot_one_wins_the_others_get_others(
    signed_in, robot, django_user_model, monkeypatch
):
    people = [django_user_model.objects.create_user(f"s{number}") for number in range(CLIENTS)]
    for person in people:
        role_set(robot=robot, user=person, role=Role.OPERATOR, actor=None)
    browsers = [signed_in(person) for person in people]
    answers, reads = [], []
    together = threading.Barrier(CLIENTS)

    def in_turn_together():
        together.wait(timeout=30.0)
        return in_turn()

    monkeypatch.setattr(views, "in_turn", in_turn_together)

    def book(browser):
        with CaptureQueriesContext(connection) as queries:
            answers.append(browser.post(reverse("booking-new"), fields(robot), **JSON))
        reads.extend(query for query in queries.captured_queries if "outofservice" in query["sql"])

    assert all_at_once([lambda browser=browser: book(browser) for browser in browsers]) == []
    assert sorted(answer.status_code for answer in answers) == [200] + [409] * (CLIENTS - 1)
    refused = [answer.json() for answer in answers if answer.status_code == 409]
    assert {one["code"] for answer in refused for one in answer["refusals"]} == {"taken"}
    assert {len(answer["alternatives"]) for answer in refused} == {3}
    assert len(reads) < CLIENTS, len(reads)  # requests at the same time share one read
