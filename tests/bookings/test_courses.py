"""Bookings of people who drive a robot by a course, or need a qualification."""

from datetime import datetime, timedelta, timezone

import pytest

from fleet.bookings.models import Booking
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant

pytestmark = pytest.mark.django_db

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=timezone.utc)


@pytest.fixture
def course(robot, stranger):
    """A course of one week, in which the stranger may drive the robot."""
    days = {"starts_on": NOW.date(), "ends_on": NOW.date() + timedelta(days=6)}
    course = Course.objects.create(name="HRI 2026", slug="hri", role="operator", week_min=120, **days)
    course.robots.add(robot)
    Enrolment.objects.create(course=course, person=stranger)
    return course


def book(robot, person, begins_h, hours=1.0):
    starts = NOW + timedelta(hours=begins_h)
    slot = Slot(starts, starts + timedelta(hours=hours))
    return booking_make(robot=robot, person=person, slot=slot, now=NOW)


def refused(*args):
    with pytest.raises(BookingRefused) as caught:
        book(*args)
    return [refusal.code for refusal in caught.value.refusals]


def test_a_booking_counts_for_the_course(robot, stranger, operator, course):
    assert book(robot, stranger, 1).course == course
    assert book(robot, operator, 3).course is None
    assert refused(robot, stranger, 5, 1.5) == ["quota_course_week"]


def test_a_slot_beyond_the_courses_last_day_is_refused(robot, stranger, course):
    assert refused(robot, stranger, 24 * 7) == ["role_too_low"]
    last_night = 24 * 6 + 14.5  # 23:30 on the last day
    with pytest.raises(
        BookingRefused, match=r"You may drive TIAGo 1 until 08 Mar 2026\. Choose an earlier"
    ) as no:
        book(robot, stranger, last_night)
    assert no.value.refusals[0].figures == {"until": "2026-03-08"}


def test_a_missing_qualification_is_named(robot, operator):
    induction = Qualification.objects.create(name="safety induction", slug="safety")
    induction.robots.add(robot)
    assert refused(robot, operator, 1) == ["unqualified"]
    expires = NOW + timedelta(days=2)
    QualificationGrant.objects.create(qualification=induction, person=operator, expires_at=expires)
    book(robot, operator, 1)
    assert refused(robot, operator, 72) == ["unqualified"]
    assert Booking.objects.count() == 1


def test_only_people_who_may_override_are_asked_for_a_reason(client, course, supervisor, second_operator):
    today = datetime.now(timezone.utc).date()
    Course.objects.update(starts_on=today - timedelta(days=2), ends_on=today + timedelta(days=20))
    course.supervisors.add(second_operator)
    for person, asked in ((second_operator, False), (supervisor, True)):
        client.force_login(person)
        for page in ("/bookings/new/", "/bookings/series/"):
            text = client.get(page).content.decode()
            assert ("Reason to book against the policy" in text) is asked, page
        assert "For another person" in client.get("/bookings/new/").content.decode()
    client.force_login(second_operator)
    day = today + timedelta(days=2)
    slot = {"starts_at": f"{day}T10:00", "ends_at": f"{day}T11:00", "override": "I want it"}
    series = {"robot": "tiago-1", "weeks": 2, "purpose": "HRI", **slot}
    assert client.post("/bookings/series/", series).status_code == 200
