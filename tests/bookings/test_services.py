"""Bookings in the database: changes, races, records."""

import threading
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import pytest
from django.db import IntegrityError, connection, transaction

from fleet.audit.integrity.verify import verify_all
from fleet.audit.models import Record
from fleet.bookings import overlaps
from fleet.bookings.free_time import free_on_any, free_slots
from fleet.bookings.models import Booking, Notification, OutOfService, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.schedule import Held, Schedule, schedule_of
from fleet.bookings.services import (
    BookingRefused,
    alternatives_of,
    booking_approve,
    booking_cancel,
    booking_hand,
    booking_make,
    booking_move,
    restore_unbegun,
    store_no_shows,
)
from robots.access.models import Course, Enrolment
from robots.registry.models import Robot, RobotRole, Role

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


def slot(begins_h, hours=1.0):
    starts = NOW + timedelta(hours=begins_h)
    return Slot(starts, starts + timedelta(hours=hours))


def book(robot, person, when=None, *, now=NOW, **options):
    return booking_make(robot=robot, person=person, slot=when or slot(1), now=now, **options)


def refused(step, *args, **options):
    with pytest.raises(BookingRefused) as caught:
        step(*args, **options)
    return [refusal.code for refusal in caught.value.refusals]


def test_a_taken_slot_is_refused_with_alternatives(robot, operator, second_operator):
    book(robot, operator)
    with pytest.raises(BookingRefused) as caught:
        book(robot, second_operator, slot(1.5))
    assert [refusal.code for refusal in caught.value.refusals] == ["taken"]
    free = alternatives_of(caught.value)
    assert [one.starts_at for _, one in free] == [slot(hours).starts_at for hours in (2, 3, 4)]


def test_the_next_free_slot_is_not_beside_ones_own(robot, other_robot, operator):
    RobotRole.objects.create(user=operator, robot=other_robot, role=Role.OPERATOR)
    book(robot, operator, slot(0.5))
    free = free_slots(robot=other_robot, person=operator, minutes=60, after=NOW, now=NOW, most=1)
    assert free == [(other_robot, slot(1.5))]


def test_one_person_books_one_robot_at_a_time(robot, other_robot, operator, staff):
    RobotRole.objects.create(user=operator, robot=other_robot, role=Role.OPERATOR)
    book(robot, operator)
    with pytest.raises(
        BookingRefused,
        match=r"You may book one robot for the same time. You have already booked TIAGo 1 from",
    ):
        book(other_robot, operator, slot(1.5))
    book(other_robot, operator, slot(1.5), actor=staff, override="two robots meet")
    Policy.objects.create(robot=other_robot, robots_at_once=2)
    book(other_robot, operator, slot(0.5))
    unused = slot(1.5).starts_at  # the grace time of the first booking is over
    book(other_robot, operator, slot(2.5), now=unused)


def test_ones_own_booking_in_the_way_is_called_so(robot, operator):
    book(robot, operator)
    with pytest.raises(BookingRefused, match=r"You have booked TIAGo 1 from .* already: change that booking"):
        book(robot, operator, slot(1.5))


def test_a_past_slot_is_refused_as_past_alone(robot, operator, second_operator):
    book(robot, operator)
    assert refused(book, robot, second_operator, slot(1), now=NOW + timedelta(hours=3)) == ["in_past"]


def test_slots_that_touch_do_not_overlap(robot, operator, second_operator):
    book(robot, operator, slot(1))
    book(robot, second_operator, slot(2))
    book(robot, second_operator, slot(0))
    assert Booking.objects.count() == 3


def test_the_database_refuses_an_overlap(robot, operator):
    booking = book(robot, operator)
    row = {"robot": robot, "person": operator, "made_at": NOW}
    times = {"starts_at": booking.starts_at, "ends_at": booking.ends_at, "held_until": booking.ends_at}
    with pytest.raises(IntegrityError, match=overlaps.NAME), transaction.atomic():
        Booking.objects.create(**row, **times)
    later = book(robot, operator, slot(3))
    with pytest.raises(IntegrityError, match=overlaps.NAME), transaction.atomic():
        Booking.objects.filter(pk=later.pk).update(starts_at=booking.starts_at)
    assert verify_all().findings == []  # verification accepts these triggers


def test_fifty_people_after_one_slot_one_wins(robot, operator):
    answers = []

    def try_to_book():
        try:
            answers.append(book(robot, operator).state)
        except BookingRefused as error:
            answers.append(error.refusals[0].code)
        finally:
            connection.close()

    threads = [threading.Thread(target=try_to_book) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(answers) == ["booked"] + ["taken"] * 11


def test_a_cancelled_slot_is_free(robot, operator, second_operator):
    booking = book(robot, operator)
    booking_cancel(booking_id=booking.pk, version=1, actor=operator, now=NOW)
    book(robot, second_operator)
    kinds = list(
        Record.objects.filter(kind__startswith="booking.").order_by("id").values_list("kind", flat=True)
    )
    assert kinds == ["booking.make", "booking.cancel", "booking.make"]


def test_finishing_early_frees_the_rest(robot, operator, second_operator):
    booking = book(robot, operator)
    Booking.objects.update(used_at=slot(1).starts_at)
    half = slot(1.5).starts_at
    booking_cancel(booking_id=booking.pk, version=1, actor=operator, now=half)
    assert Booking.objects.get(pk=booking.pk).state == State.FINISHED
    book(robot, second_operator, slot(1.5), now=half)


def test_an_offer_is_declined_at_any_time_but_not_passed_on(robot, operator, second_operator, staff):
    Policy.objects.create(cancel_notice_min=600)
    offer = book(robot, operator)
    Booking.objects.update(state=State.OFFERED)
    asked = {"booking_id": offer.pk, "version": 1, "now": NOW}
    assert refused(booking_move, **asked, actor=operator, slot=slot(5)) == ["offered"]
    assert refused(booking_hand, **asked, actor=operator, to=second_operator) == ["offered"]
    booking_cancel(**asked, actor=operator)
    assert Booking.objects.get().state == State.CANCELLED


def test_a_stale_offer_cannot_be_declined_after_its_end(robot, operator):
    offer = book(robot, operator)
    Booking.objects.update(state=State.OFFERED)
    booking_cancel(booking_id=offer.pk, version=1, actor=operator, now=slot(3).starts_at)
    offer.refresh_from_db()
    assert (offer.state, offer.held_until) == (State.CANCELLED, offer.starts_at)


def test_a_request_may_be_cancelled_within_the_notice(robot, operator):
    Policy.objects.create(robot=robot, needs_approval=True, cancel_notice_min=24 * 60)
    awaits = book(robot, operator)
    booking_cancel(booking_id=awaits.pk, version=1, actor=operator, now=NOW)
    assert Booking.objects.get().state == State.CANCELLED


def no_shows():
    return [record.parameters["booking"] for record in Record.objects.filter(kind="booking.no_show")]


def test_a_slot_that_nobody_used_is_on_record_a_day_later(robot, operator, second_operator):
    unused, used = book(robot, operator), book(robot, second_operator, slot(2))
    Booking.objects.filter(pk=used.pk).update(used_at=slot(2).starts_at)
    store_no_shows(slot(15.9).starts_at)  # a clock set to local time may be so far ahead
    assert no_shows() == []
    assert Booking.objects.get(pk=unused.pk).held_until == unused.ends_at
    for _ in range(2):  # housekeeping may run twice
        store_no_shows(slot(24).starts_at)
    assert no_shows() == [str(unused.pk)]
    states = dict(Booking.objects.values_list("pk", "state"))
    assert states == {unused.pk: State.NO_SHOW, used.pk: State.BOOKED}


def test_who_watched_the_clock_notes_at_once_that_nobody_used_a_slot(robot, operator):
    unused = book(robot, operator)
    begins, ends = unused.starts_at, unused.starts_at + timedelta(minutes=15)
    store_no_shows(ends, watched=timedelta(minutes=14))  # it began before the watch did
    store_no_shows(ends - timedelta(seconds=1), watched=timedelta(hours=2))
    assert no_shows() == []
    store_no_shows(ends, watched=timedelta(minutes=16))
    unused.refresh_from_db()
    assert (no_shows(), unused.state, unused.held_until) == ([str(unused.pk)], State.NO_SHOW, ends)
    assert "not used" in Notification.objects.get(person=operator).subject
    restore_unbegun(begins)  # it has begun
    assert len(no_shows()) == 1 and Booking.objects.get().state == State.NO_SHOW
    restore_unbegun(begins - timedelta(minutes=1))  # the clock was ahead
    unused.refresh_from_db()
    assert (unused.state, unused.held_until) == (State.BOOKED, unused.ends_at)


def test_the_longest_slot_is_noted_too(robot, operator):
    Policy.objects.create(robot=robot, longest_min=7 * 24 * 60)
    longest = book(robot, operator, slot(1, 7 * 24))
    store_no_shows(longest.ends_at + timedelta(days=2))
    assert no_shows() == [str(longest.pk)]


def test_a_slot_of_a_robot_out_of_service_is_no_no_show(robot, operator, staff):
    book(robot, operator)
    OutOfService.objects.create(robot=robot, starts_at=slot(1).starts_at, ends_at=slot(2).starts_at)
    store_no_shows(slot(24).starts_at)
    assert no_shows() == []
    OutOfService.objects.all().delete()
    Robot.objects.update(enabled=False)  # the robot may also have been disabled then
    store_no_shows(slot(24).starts_at)
    assert no_shows() == []


@pytest.fixture
def course(robot, stranger):
    """A course until today, in which the stranger may drive the robot."""
    course = Course.objects.create(
        name="HRI", slug="hri", role=Role.OPERATOR, starts_on=NOW.date(), ends_on=NOW.date()
    )
    course.robots.add(robot)
    Enrolment.objects.create(course=course, person=stranger)
    return course


def proposed(robot, person, after, minutes=60, **options):
    asked = {"robot": robot, "person": person, "minutes": minutes, "now": NOW, **options}
    return [one for _, one in free_slots(after=slot(after).starts_at, **asked)]


def test_no_time_after_the_course_is_proposed(robot, stranger, course):
    assert proposed(robot, stranger, 12, most=4) == [slot(hours) for hours in (12, 13, 14)]
    assert proposed(robot, stranger, 13.5, minutes=120) == []  # it would end after midnight


def test_a_course_that_begins_tomorrow_is_found_by_the_search(robot, stranger, course):
    tomorrow = NOW.date() + timedelta(days=1)
    Course.objects.update(starts_on=tomorrow, ends_on=tomorrow)
    assert proposed(robot, stranger, 12, most=1) == [slot(15)]  # midnight


def test_a_course_that_begins_in_four_days_is_found_by_the_search(robot, stranger, course):
    days = {"starts_on": NOW.date() + timedelta(days=4), "ends_on": NOW.date() + timedelta(days=4)}
    Course.objects.update(**days)
    assert proposed(robot, stranger, 0, most=1) == [slot(4 * 24 - 9)]


def test_a_slot_that_runs_gets_no_other_times(robot, operator, second_operator):
    mine, _next = book(robot, operator), book(robot, second_operator, slot(2))
    longer = Slot(mine.starts_at, slot(2.5).starts_at)
    asked = {"booking_id": mine.pk, "version": 1, "slot": longer, "actor": operator}
    with pytest.raises(BookingRefused) as caught:
        booking_move(**asked, now=slot(1.1).starts_at)
    assert [one.code for one in caught.value.refusals] == ["taken"]
    assert alternatives_of(caught.value) == []


def test_a_late_move_to_a_taken_time_is_told_both(robot, operator, second_operator):
    Policy.objects.create(robot=robot, cancel_notice_min=120)
    mine, _other = book(robot, operator), book(robot, second_operator, slot(4))
    with pytest.raises(BookingRefused) as caught:
        booking_move(booking_id=mine.pk, version=1, slot=slot(4), actor=operator, now=NOW)
    assert [one.code for one in caught.value.refusals] == ["taken", "late_to_cancel"]
    assert alternatives_of(caught.value) == []


def test_a_slot_that_is_too_late_to_move_gets_no_other_times(robot, operator, second_operator):
    Policy.objects.create(robot=robot, cancel_notice_min=120)
    mine, _next = book(robot, operator), book(robot, second_operator, slot(2))
    longer = Slot(mine.starts_at, slot(2.5).starts_at)
    with pytest.raises(BookingRefused) as caught:
        booking_move(booking_id=mine.pk, version=1, slot=longer, actor=operator, now=NOW)
    assert [one.code for one in caught.value.refusals] == ["taken"]
    assert alternatives_of(caught.value) == []


def test_of_two_courses_the_one_with_time_left_finds_the_next_day(robot, stranger, course):
    """Today is full of other bookings, and tomorrow the first course has no time left."""
    Course.objects.update(ends_on=NOW.date() + timedelta(days=1), day_min=60)
    second = Course.objects.create(
        name="Thesis",
        slug="thesis",
        role="operator",
        starts_on=NOW.date(),
        ends_on=course.ends_on + timedelta(days=1),
    )
    second.robots.add(robot)
    Enrolment.objects.create(course=second, person=stranger)
    tomorrow = {"series": None, "course": course, "made_at": NOW, "robot": robot, "person": stranger}
    taken = slot(20)
    Booking.objects.create(
        starts_at=taken.starts_at, ends_at=taken.ends_at, held_until=taken.ends_at, **tomorrow
    )
    assert proposed(robot, stranger, 14, most=2) == [slot(14), slot(15)]


def test_a_week_whose_quota_is_used_up_leads_to_the_next(robot, operator, django_assert_max_num_queries):
    Policy.objects.create(
        robot=robot, week_min=90, opening={"mon": [["09:10", "12:00"]], "tue": [["09:00", "24:00"]]}
    )
    book(robot, operator)
    week_h = 7 * 24
    assert proposed(robot, operator, 0, minutes=30, most=1) == [slot(0.25, 0.5)]
    with django_assert_max_num_queries(40):
        assert proposed(robot, operator, 0) == [slot(week_h + hours) for hours in (0.25, 1.25, 24)]
    Policy.objects.update(horizon_days=6)
    assert proposed(robot, operator, 1) == []


def test_of_two_robots_the_one_that_is_free_first_is_found(robot, other_robot, operator):
    RobotRole.objects.create(user=operator, robot=other_robot, role=Role.OPERATOR)
    OutOfService.objects.create(robot=other_robot, starts_at=NOW, ends_at=slot(3).starts_at)
    asked = {"person": operator, "minutes": 60, "after": NOW, "now": NOW}
    for robots in ((robot, other_robot), (other_robot, robot)):
        assert free_on_any(robots, most=1, **asked) == [(robot, slot(0))]


def test_no_time_is_free_in_a_period_out_of_service(robot, operator):
    book(robot, operator, slot(0, 2))
    OutOfService.objects.create(robot=robot, starts_at=slot(2).starts_at, ends_at=slot(4).starts_at)
    assert schedule_of(robot, NOW).free_from(NOW) == slot(4).starts_at


def test_a_move_to_a_taken_time_gets_times_for_the_same_booking(robot, operator, second_operator):
    Policy.objects.create(robot=robot, at_once=1)
    mine, _other = book(robot, operator), book(robot, second_operator, slot(14))
    with pytest.raises(BookingRefused) as caught:
        booking_move(booking_id=mine.pk, version=1, slot=slot(14), actor=operator, now=NOW)
    assert [one for _, one in alternatives_of(caught.value)] == [slot(hours) for hours in (15, 16, 17)]


def test_an_unused_slot_is_free_after_the_grace_time(robot, operator, second_operator):
    unused = book(robot, operator)
    grace = slot(1.25).starts_at
    before = grace - timedelta(seconds=1)
    assert schedule_of(robot, before).current.person == operator.id
    assert refused(book, robot, second_operator, slot(1.3, 0.5), now=before) == ["taken"]
    assert schedule_of(robot, grace).current is None
    book(robot, second_operator, slot(1.3, 0.5), now=grace)
    assert Booking.objects.get(pk=unused.pk).state == State.NO_SHOW


def test_of_two_tabs_that_move_a_booking_the_later_is_refused(robot, operator):
    booking = book(robot, operator)
    booking_move(booking_id=booking.pk, version=1, slot=slot(3), actor=operator, now=NOW)
    late = {"booking_id": booking.pk, "version": 1, "slot": slot(5), "actor": operator, "now": NOW}
    assert refused(booking_move, **late) == ["changed"]
    assert Booking.objects.get(pk=booking.pk).starts_at == slot(3).starts_at


def test_a_running_slot_may_be_lengthened_but_not_its_start(robot, operator):
    booking = book(robot, operator)
    halfway = slot(1.5).starts_at
    Booking.objects.filter(pk=booking.pk).update(used_at=slot(1).starts_at)
    booking_move(booking_id=booking.pk, version=1, slot=slot(0.5, 2), actor=operator, now=halfway)
    moved = Booking.objects.get(pk=booking.pk)
    assert (moved.starts_at, moved.held_until) == (slot(1).starts_at, slot(2.5).starts_at)


def test_only_owner_and_supervisor_change_a_booking(robot, operator, second_operator, supervisor):
    booking = book(robot, operator)
    assert refused(booking_cancel, booking_id=booking.pk, version=1, actor=second_operator, now=NOW) == [
        "not_yours"
    ]
    booking_cancel(booking_id=booking.pk, version=1, actor=supervisor, now=NOW)


def test_a_supervisor_overrides_with_a_recorded_reason(robot, operator, supervisor):
    assert refused(book, robot, operator, slot(1, 6)) == ["too_long"]
    assert refused(book, robot, operator, slot(1, 6), override="demo day") == ["too_long"]
    book(robot, operator, slot(1, 6), actor=supervisor, override="demo day")
    assert Record.objects.get(kind="booking.make").content.text == "demo day"


def test_a_booking_that_awaits_approval_holds_the_slot(robot, operator, second_operator, supervisor):
    Policy.objects.create(robot=robot, needs_approval=True)
    booking = book(robot, operator)
    assert refused(book, robot, second_operator) == ["taken"]
    assert schedule_of(robot, slot(1.1).starts_at).current is None
    booking_approve(booking_id=booking.pk, version=1, actor=supervisor, now=NOW)
    assert schedule_of(robot, slot(1.1).starts_at).current.person == operator.id


def test_a_booking_is_handed_to_a_colleague_who_may_drive(robot, operator, second_operator, observer):
    booking = book(robot, operator)
    to_observer = {"booking_id": booking.pk, "version": 1, "to": observer, "actor": operator, "now": NOW}
    assert refused(booking_hand, **to_observer) == ["role_too_low"]
    for person in (operator, second_operator):
        type(person).objects.filter(pk=person.pk).update(email=f"{person.username}@lab.example")
        person.refresh_from_db()
    booking_hand(**(to_observer | {"to": second_operator}))
    [notification] = Notification.objects.all()  # none for the owner, who handed it over
    assert (notification.person, notification.subject) == (
        second_operator,
        "Your booking of TIAGo 1: handed to you",
    )
    assert Booking.objects.get(pk=booking.pk).person == second_operator


@pytest.mark.parametrize(
    ("minutes", "free_after"),
    [
        ([], 0),
        ([(30, 60)], 0),
        ([(-10, 20), (50, 60)], 20),
        ([(-10, 20), (20, 40), (40, 90)], 90),
        ([(-10, 20), (20.5, 40)], 40),  # half a minute is no free time
        ([(-10, 1500)], None),
    ],
)
def test_the_next_free_time_is_behind_a_chain_of_bookings(minutes, free_after):
    now = NOW

    def held(begins: float, ends: float) -> Held:
        slot = Slot(now + timedelta(minutes=begins), now + timedelta(minutes=ends))
        return Held(uuid4(), uuid4(), "Ada", slot, now)

    slots = [held(*one) for one in minutes]
    current = next((one for one in slots if one.slot.starts_at <= now), None)
    schedule = Schedule(current, tuple(one for one in slots if one.slot.starts_at > now))
    expected = None if free_after is None else now + timedelta(minutes=free_after)
    assert schedule.free_from(now) == expected


def test_a_booked_robot_that_is_out_for_good_has_no_free_time(robot, operator):
    book(robot, operator)
    OutOfService.objects.create(robot=robot, starts_at=NOW, why="repair")
    assert schedule_of(robot, NOW).free_from(NOW) is None
