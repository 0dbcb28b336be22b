"""Bookings of people who drive a robot by a course, or need a qualification."""

from datetime import UTC, datetime, timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.models import Booking, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_cancel, booking_make, booking_move
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant
from robots.access.selectors import lab_date
from tests.bookings.test_pages import JSON, fields

pytestmark = pytest.mark.django_db

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


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


def hour(begins_h):
    return Slot(NOW + timedelta(hours=begins_h), NOW + timedelta(hours=begins_h + 1))


def refused(*args):
    with pytest.raises(BookingRefused) as caught:
        book(*args)
    return [refusal.code for refusal in caught.value.refusals]


def test_a_booking_counts_for_the_course(robot, stranger, operator, course):
    assert book(robot, stranger, 1).course == course
    assert book(robot, operator, 3).course is None
    assert refused(robot, stranger, 5, 1.5) == ["quota_course_week"]


def test_people_of_a_course_book_before_it_begins(client, robot, stranger, course):
    monday = lab_date() + timedelta(days=7)
    Course.objects.update(starts_on=monday, ends_on=monday)
    client.force_login(stranger)
    fleet = client.get("/").content.decode()
    assert "Your course HRI 2026 begins on" in fleet and robot.name not in fleet
    days = {"start": monday, "end": monday + timedelta(days=1)}
    calendar = client.get(reverse("bookings-feed"), days).json()
    assert [one["id"] for one in calendar["resources"]] == [robot.slug]
    times = {"starts_at": f"{monday}T10:00", "ends_at": f"{monday}T11:00"}
    assert client.post(reverse("booking-new"), {"robot": robot.slug, **times}, **JSON).status_code == 200
    assert reverse("control", args=[robot.slug]) not in client.get(reverse("bookings-mine")).content.decode()
    assert client.get(reverse("control", args=[robot.slug])).status_code == 404  # the course has not begun
    found = client.get("/api/v1/bookings", {"robot": robot.slug}).json()
    assert [one["yours"] for one in found["bookings"]] == [True]
    Course.objects.update(role="observer")  # observers do not book
    assert client.get(reverse("bookings-feed"), days).json()["resources"] == []
    assert "You can book" not in client.get("/").content.decode()


def test_the_teacher_of_a_coming_course_books_its_lessons(client, robot, stranger, course):
    monday = lab_date() + timedelta(days=7)
    Course.objects.update(starts_on=monday, ends_on=monday)
    Enrolment.objects.all().delete()
    course.supervisors.add(stranger)
    client.force_login(stranger)
    times = {"starts_at": f"{monday}T10:00", "ends_at": f"{monday}T11:00"}
    asked = {"robot": robot.slug, **times, "weeks": 1, "purpose": "HRI", "course": "hri", "action": "book"}
    assert client.post(reverse("booking-series"), asked).status_code == 302
    assert Booking.objects.get().person == stranger
    assert "Your course HRI 2026 begins on" in client.get("/").content.decode()


@pytest.fixture
def thesis(robot, stranger, course):
    """Another course of the same person."""
    days = {"starts_on": course.starts_on, "ends_on": course.ends_on}
    thesis = Course.objects.create(name="Thesis", slug="thesis", role="operator", week_min=60, **days)
    thesis.robots.add(robot)
    Enrolment.objects.create(course=thesis, person=stranger)
    return thesis


def test_in_two_courses_the_quota_of_the_second_counts_next(robot, stranger, course, thesis):
    assert book(robot, stranger, 1, 1.5).course == course
    assert book(robot, stranger, 3).course == thesis
    assert refused(robot, stranger, 5) == ["quota_course_week"]


def test_a_person_in_two_courses_chooses(signed_in, robot, stranger, course, thesis):
    browser, today = signed_in(stranger), lab_date()
    Course.objects.update(starts_on=today, ends_on=today + timedelta(days=13))
    monday = 24 * (7 - today.weekday())  # the quota is one of a week: both times lie in the next one
    for page in ("booking-new", "bookings"):  # the form, and the calendar's dialog
        assert '<option value="thesis">Thesis</option>' in browser.get(reverse(page)).content.decode()
    answer = browser.post(reverse("booking-new"), fields(robot, monday, course="thesis"), **JSON)
    assert answer.status_code == 200
    assert Booking.objects.get().course == thesis
    later = fields(robot, monday + 4, course="thesis")
    answer = browser.post(reverse("booking-new"), later, **JSON)
    assert [one["code"] for one in answer.json()["refusals"]] == ["quota_course_week"]
    thesis.robots.clear()
    answer = browser.post(reverse("booking-new"), later, **JSON)
    assert [one["code"] for one in answer.json()["refusals"]] == ["wrong_course"]


def test_pages_show_what_is_left(signed_in, robot, stranger, course, staff):
    today = lab_date()
    quotas = {"day_min": 60, "at_once": 3, "course_week_min": 600}
    Course.objects.update(starts_on=today, ends_on=today + timedelta(days=6), **quotas)
    Policy.objects.create(week_min=300)
    midnight = timezone.now().replace(hour=0, minute=0)
    times = {"starts_at": midnight, "ends_at": midnight + timedelta(minutes=30)}
    Booking.objects.create(
        robot=robot, person=stranger, course=course, **times, held_until=times["ends_at"], made_at=midnight
    )
    to_come = 2 if timezone.now() < times["ends_at"] else 3  # until 00:30 this booking is not over
    for page in ("bookings-mine", "booking-new"):
        text = signed_in(stranger).get(reverse(page)).content.decode()
        own = ("30 min of 1 h today", "1 h 30 min of 2 h this week", f"{to_come} of 3 bookings to come")
        rests = (*own, "9 h 30 min of 10 h this week for the whole course")
        assert f"<dt>HRI 2026</dt>{''.join(f'<dd>{rest}</dd>' for rest in rests)}" in text
        assert "<dt>all robots</dt><dd>4 h 30 min of 5 h this week</dd>" in text
    text = signed_in(staff).get(reverse("bookings-course", args=["hri"])).content.decode()
    assert "Left: 9 h 30 min of 10 h this week for the whole course." in text


def test_a_moved_booking_stays_in_its_course(robot, stranger, course, thesis):
    booking = booking_make(robot=robot, person=stranger, slot=hour(1), now=NOW, course=thesis)
    booking_move(booking_id=booking.pk, version=1, slot=hour(5), actor=stranger, now=NOW)
    booking.refresh_from_db()
    assert booking.course == thesis


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


def test_who_waits_keeps_purpose_course_and_the_wish_to_record(
    signed_in, robot, operator, stranger, course, thesis
):
    browser, today = signed_in(stranger), lab_date()
    Course.objects.update(starts_on=today, ends_on=today + timedelta(days=13))
    monday = 24 * (7 - today.weekday())
    booked = signed_in(operator).post(reverse("booking-new"), fields(robot, monday, record="on"), **JSON)
    assert booked.status_code == 200
    assert "Recorded" in signed_in(operator).get(reverse("bookings-mine")).content.decode()
    asked = fields(robot, monday, course="thesis", purpose="night test", record="on")
    assert browser.post(reverse("bookings-waiting"), asked, **JSON).status_code == 200
    page = browser.get(reverse("bookings-mine")).content.decode()
    assert "night test" in page and "Recorded" in page
    details = Record.objects.get(kind="booking.wait").details
    assert (details["purpose"], details["record"]) == ("night test", True)
    booking_cancel(booking_id=Booking.objects.get().pk, version=1, actor=operator, now=timezone.now())
    offer = Booking.objects.get(state=State.OFFERED)
    assert (offer.person, offer.purpose, offer.course) == (stranger, "night test", thesis)
    assert offer.record


def test_only_people_who_may_override_are_asked_for_a_reason(client, course, supervisor, second_operator):
    today = datetime.now(UTC).date()
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


def test_a_page_that_reads_itself_again_takes_no_messages(signed_in, robot, operator):
    starts = timezone.now() + timedelta(hours=2)
    slot = Slot(starts, starts + timedelta(hours=1))
    booking = booking_make(robot=robot, person=operator, slot=slot, now=timezone.now())
    browser, mine = signed_in(operator), reverse("bookings-mine")
    html = {"Accept": "text/html"}
    cancel = {"action": "cancel", "version": booking.version, "back": mine}
    assert browser.post(reverse("booking", args=[booking.pk]), cancel, headers=html).status_code == 302
    assert "Cancelled:" not in browser.get(mine, headers=html | {"X-Live": "1"}).content.decode()
    assert "Cancelled:" in browser.get(mine, headers=html).content.decode()
