"""Time that changes hands counts once: what has passed for the person who had it, the rest for the receiver."""

from datetime import UTC, datetime, timedelta
from uuid import uuid4

import pytest

from fleet.audit.models import Record
from fleet.bookings.hours.quota_left import left_of
from fleet.bookings.models import Booking, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import (
    BookingRefused,
    booking_hand,
    booking_make,
    booking_move,
    store_no_shows,
)
from robots.access.models import Course, Enrolment
from robots.access.services import role_set
from robots.registry.models import Role
from teleop.control import services
from teleop.control.lease_checks import Tab
from tests.bookings.test_races import all_at_once

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


def at(minutes):
    return NOW + timedelta(minutes=minutes)


def book(robot, person, begins_min, minutes, now_min=0.0, **options):
    slot = Slot(at(begins_min), at(begins_min + minutes))
    return booking_make(robot=robot, person=person, slot=slot, now=at(now_min), **options)


def tab(person):
    return Tab(f"{person.username}-tab", f"{person.username}-sign-in", f"{person.username}-connection")


def take(robot, person, now_min):
    services.lease_take(
        robot_id=robot.id, user_id=person.id, tab=tab(person), highest_fence=0, now=at(now_min)
    )


def hand_booking(robot, giver, receiver, now_min):
    """Hand the booking that runs, as *My bookings* does; return the code of the refusal, if any."""
    booking = Booking.objects.get(
        robot=robot, person=giver, starts_at__lte=at(now_min), held_until__gt=at(now_min)
    )
    try:
        booking_hand(
            booking_id=booking.pk, version=booking.version, to=receiver, actor=giver, now=at(now_min)
        )
    except BookingRefused as error:
        return error.refusal.code
    return None


def minutes_of(person):
    times = Booking.objects.filter(person=person).values_list("starts_at", "held_until")
    return sum((ends - starts).total_seconds() for starts, ends in times) / 60


def test_time_that_is_handed_back_needs_room_in_the_quota(robot, operator, second_operator):
    Policy.objects.create(robot=robot, day_min=60)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    assert hand_booking(robot, operator, second_operator, 5) is None
    with pytest.raises(BookingRefused) as caught:
        book(robot, operator, 120, 60, 6)
    assert caught.value.refusal.figures["left_min"] == 55
    book(robot, operator, 120, 55, 6)
    take(robot, second_operator, 6)
    assert hand_booking(robot, second_operator, operator, 6) == "quota_day"
    assert (minutes_of(operator), minutes_of(second_operator)) == (60, 55)


def test_the_rest_of_a_slot_needs_room_in_the_receivers_quota(robot, operator, second_operator):
    Policy.objects.create(robot=robot, day_min=60)
    book(robot, second_operator, 120, 30)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    assert hand_booking(robot, operator, second_operator, 5) == "quota_day"
    assert hand_booking(robot, operator, second_operator, 30) is None
    assert (minutes_of(operator), minutes_of(second_operator)) == (30, 60)


def test_the_rest_of_a_slot_keeps_the_gap_to_the_next_one(robot, operator, second_operator):
    Policy.objects.create(robot=robot, gap_min=30)
    book(robot, second_operator, 80, 30)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    assert hand_booking(robot, operator, second_operator, 5) == "gap"
    Policy.objects.update(gap_min=20)
    assert hand_booking(robot, operator, second_operator, 6) is None
    take(robot, second_operator, 6)
    assert hand_booking(robot, second_operator, operator, 7) is None


def test_a_slot_that_goes_back_and_forth_counts_each_minute_once(robot, operator, second_operator):
    Policy.objects.create(robot=robot, day_min=60)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    for number in range(6):
        people = (operator, second_operator) if number % 2 == 0 else (second_operator, operator)
        assert hand_booking(robot, *people, 5 + number) is None
    assert minutes_of(operator) + minutes_of(second_operator) == 60
    assert not Booking.objects.filter(ends_at__lt=at(60), held_until=at(60)).exists()


@pytest.mark.parametrize(
    ("limits", "code"),
    [
        ({"at_once": 1}, "quota_open"),
        ({"week_min": 60}, "quota_week"),
        ({"robots_at_once": 1}, "robots_at_once"),
    ],
)
def test_handing_back_is_no_way_around_any_count(limits, code, robot, other_robot, operator, second_operator):
    Policy.objects.create(**limits)
    role_set(robot=other_robot, user=operator, role=Role.OPERATOR, actor=None)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    assert hand_booking(robot, operator, second_operator, 5) is None
    book(other_robot, operator, 10, 55, 6)
    assert hand_booking(robot, second_operator, operator, 7) == code


@pytest.fixture
def course(robot, stranger, staff, django_user_model):
    """A course with quotas, and two of its people."""
    made = Course.objects.create(
        name="HRI",
        slug="hri",
        role=Role.OPERATOR,
        starts_on=NOW.date(),
        ends_on=NOW.date() + timedelta(days=3650),
        day_min=60,
        course_week_min=100,
    )
    made.robots.add(robot)
    second = django_user_model.objects.create_user("student")
    for person in (stranger, second):
        Enrolment.objects.create(course=made, person=person)
    return made, stranger, second


def test_a_courses_quotas_hold_when_time_is_handed_on(robot, course):
    hri, first, second = course
    book(robot, first, 0, 60)
    take(robot, first, 0)
    book(robot, second, 120, 40)
    assert hand_booking(robot, first, second, 5) == "quota_course_day"
    assert hand_booking(robot, first, second, 45) is None
    counted = Booking.objects.filter(course=hri, shared="")
    assert sum((one.held_until - one.starts_at).total_seconds() for one in counted) == 100 * 60


def test_a_lesson_stays_one_for_another_teacher_only(robot, course, supervisor, staff):
    hri, first, _second = course
    hri.supervisors.add(supervisor)
    Course.objects.update(day_min=None, course_week_min=None)
    lesson = book(robot, staff, 0, 120, lesson_of=hri, series=uuid4(), turn_min=10)
    assert hand_booking(robot, staff, supervisor, 5) is None
    rest = Booking.objects.get(person=supervisor)
    assert (rest.course, rest.series, rest.shared, rest.turn_min) == (hri, lesson.series, "course", 10)
    assert hand_booking(robot, supervisor, first, 10) is None
    last = Booking.objects.get(person=first)
    assert (last.shared, last.turn_min) == ("", None)  # a student's slot counts for their quotas


def test_no_quota_of_a_policy_counts_a_lesson(robot, course, supervisor):
    hri, *_students = course
    Policy.objects.create(robot=robot, day_min=60, week_min=60, at_once=1, gap_min=10)
    hri.supervisors.add(supervisor)
    book(robot, supervisor, 0, 120, lesson_of=hri, series=uuid4())
    with pytest.raises(BookingRefused) as caught:
        book(robot, supervisor, 125, 60)
    assert caught.value.refusal.code == "gap"
    assert any("1 h of 1 h today" in rest for left in left_of(supervisor, at(0)) for rest in left.rests)
    book(robot, supervisor, 130, 60)
    with pytest.raises(BookingRefused) as caught:
        book(robot, supervisor, 200, 15)
    assert caught.value.refusal.code == "quota_day"


def test_who_hands_an_unused_slot_on_is_no_no_show(robot, operator, second_operator):
    given = book(robot, operator, 0, 60)
    assert hand_booking(robot, operator, second_operator, 5) is None
    store_no_shows(at(60 * 24))
    noted = set(Record.objects.filter(kind="booking.no_show").values_list("parameters__person", flat=True))
    assert noted == {str(second_operator.pk)}
    given.refresh_from_db()
    assert given.state == State.FINISHED


def test_a_slot_is_handed_back_while_its_receiver_books(robot, other_robot, operator, second_operator):
    Policy.objects.create(day_min=60, robots_at_once=2)
    role_set(robot=other_robot, user=operator, role=Role.OPERATOR, actor=None)
    book(robot, operator, 0, 60)
    take(robot, operator, 0)
    assert hand_booking(robot, operator, second_operator, 5) is None
    steps = [
        lambda: hand_booking(robot, second_operator, operator, 6),
        lambda: book(other_robot, operator, 120, 55, 6),
    ]
    errors = all_at_once(steps)
    assert all(isinstance(error, BookingRefused) for error in errors), errors
    assert minutes_of(operator) <= 60


def test_a_series_that_moves_into_a_course_counts_there(robot, operator, staff):
    booking = book(robot, operator, 60, 60, series=uuid4())
    role_set(robot=robot, user=operator, role=None, actor=staff)
    course = Course.objects.create(
        name="HRI", slug="hri", role=Role.OPERATOR, starts_on=NOW.date(), ends_on=NOW.date(), day_min=60
    )
    course.robots.add(robot)
    Enrolment.objects.create(course=course, person=operator)
    booking.refresh_from_db()
    moved = booking_move(
        booking_id=booking.pk, version=booking.version, slot=Slot(at(90), at(150)), actor=operator, now=NOW
    )
    assert (moved.course, moved.shared) == (course, "")
    with pytest.raises(BookingRefused) as caught:
        book(robot, operator, 200, 30)
    assert caught.value.refusal.code == "quota_course_day"
