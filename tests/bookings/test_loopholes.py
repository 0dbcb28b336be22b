"""Ways around the rules of booking, each tried at the page where a person would try it."""

import time
from datetime import UTC, datetime, timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.bookings.changes.waiting_list import keep_waiting_lists, offer_accept, waiting_join
from fleet.bookings.messages.notifications import write_reminders
from fleet.bookings.models import Booking, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import Stage, grace_of, policy_of, stage_of
from fleet.bookings.services import booking_approve, booking_cancel, booking_make
from robots.access.models import Course, Enrolment
from robots.access.selectors import lab_date
from robots.access.services import role_set
from robots.registry.models import Robot, Role
from tests.bookings.support import accept
from tests.bookings.test_pages import JSON, fields, in_hours

pytestmark = pytest.mark.django_db(transaction=True)


def minutes(number):
    """Return a full minute from now."""
    return timezone.now().replace(second=0, microsecond=0) + timedelta(minutes=number)


def typed(starts, ends, **others):
    return {"starts_at": f"{starts:%Y-%m-%dT%H:%M}", "ends_at": f"{ends:%Y-%m-%dT%H:%M}", **others}


def stored(robot, person, begins_min, ends_min, **values):
    starts, ends = minutes(begins_min), minutes(ends_min)
    times = {"starts_at": starts, "ends_at": ends, "held_until": ends, "made_at": starts}
    return Booking.objects.create(robot=robot, person=person, **times, **values)


def change(browser, booking, action="move", **posted):
    posted = {"action": action, "version": booking.version, **posted}
    answer = browser.post(reverse("booking", args=[booking.pk]), posted, **JSON)
    booking.refresh_from_db()
    return [refusal["code"] for refusal in answer.json().get("refusals", [])]


def stage(booking):
    return stage_of(booking, grace_of(policy_of(booking.robot)), timezone.now())


# --- for others ------------------------------------------------------------------------------------


def test_only_supervisors_of_the_robot_book_it_for_others(
    signed_in, robot, other_robot, supervisor, second_operator
):
    role_set(robot=other_robot, user=supervisor, role=Role.OBSERVER, actor=None)
    role_set(robot=other_robot, user=second_operator, role=Role.OPERATOR, actor=None)
    browser, whom = signed_in(supervisor), second_operator.username
    answer = browser.post(reverse("booking-new"), fields(other_robot, person=whom), **JSON)
    assert [refusal["code"] for refusal in answer.json()["refusals"]] == ["not_for_others"]
    assert browser.post(reverse("booking-new"), fields(robot, person=whom), **JSON).status_code == 200
    assert [one.robot for one in Booking.objects.all()] == [robot]


def test_words_about_another_person_name_them(signed_in, robot, operator, observer, supervisor):
    booking = stored(robot, operator, 60, 120)
    posted = {"action": "hand", "version": 1, "to": observer.username}
    answer = signed_in(supervisor).post(reverse("booking", args=[booking.pk]), posted, **JSON)
    [refusal] = answer.json()["refusals"]
    assert refusal["text"].startswith(f"For {observer.display_name}: You may not drive TIAGo 1")
    assert refusal["said"]["text"][0] == "For {name}: {text}"


def test_handing_over_tells_nobody_who_has_an_account(signed_in, robot, operator, observer, stranger):
    booking = stored(robot, operator, 60, 120)
    browser = signed_in(operator)
    texts = set()
    for name in (observer.username, stranger.username, "nobody"):
        posted = {"action": "hand", "version": 1, "to": name}
        answer = browser.post(reverse("booking", args=[booking.pk]), posted, **JSON)
        texts |= {refusal["text"].replace(name, "NAME") for refusal in answer.json()["refusals"]}
    assert texts == {"Nobody with the user name NAME may drive TIAGo 1 at this time."}


def test_booking_for_another_tells_no_supervisor_who_has_an_account(
    signed_in, robot, course, supervisor, stranger
):
    teacher = User.objects.create_user("teacher", password="a long walk")
    course.supervisors.add(teacher)
    Enrolment.objects.filter(person=stranger).delete()
    booking = stored(robot, teacher, 180, 240, course=course)
    for person, code in ((supervisor, "no_account"), (teacher, "not_for_others")):
        browser = signed_in(person)
        seen = set()
        for name in (stranger.username, "nobody"):
            books = browser.post(reverse("booking-new"), fields(robot, person=name), **JSON)
            hands = browser.post(
                reverse("booking", args=[booking.pk]), {"action": "hand", "version": 1, "to": name}, **JSON
            )
            both = books.content.decode() + hands.content.decode()
            assert code in both
            assert "no_colleague" in both
            seen.add(both.replace(name, "NAME"))
        assert len(seen) == 1, person.username


def test_a_reason_counts_only_from_supervisors_of_the_robot(signed_in, robot, other_robot, supervisor):
    role_set(robot=other_robot, user=supervisor, role=Role.OPERATOR, actor=None)
    signed_in(supervisor).post(reverse("booking-new"), fields(other_robot, override="because"), **JSON)
    booking = Booking.objects.get()
    assert not booking.overridden  # overridden bookings stay when the right to drive is lost
    change(signed_in(supervisor), booking, **fields(other_robot, 4, override="because"))
    assert not booking.overridden


def test_a_robot_that_staff_switched_off_is_not_booked(signed_in, robot, operator):
    Robot.objects.update(enabled=False)
    answer = signed_in(operator).post(reverse("booking-new"), fields(robot), **JSON)
    [refusal] = answer.json()["refusals"]
    assert (refusal["code"], "until further notice (staff switched it off)" in refusal["text"]) == (
        "out_of_service",
        True,
    )


# --- courses ---


@pytest.fixture
def course(robot, stranger):
    """A course until tomorrow: each of its people may have one booking to come."""
    days = {"starts_on": lab_date(), "ends_on": lab_date() + timedelta(days=1)}
    made = Course.objects.create(name="HRI", slug="hri", role=Role.OPERATOR, at_once=1, **days)
    made.robots.add(robot)
    Enrolment.objects.create(course=made, person=stranger)
    return made


def test_a_slot_may_last_until_the_midnight_that_ends_the_course(signed_in, robot, course, stranger):
    midnight = timezone.now().replace(hour=0, minute=0, second=0, microsecond=0) + timedelta(days=2)
    times = typed(midnight - timedelta(minutes=30), midnight, robot=robot.slug)
    assert signed_in(stranger).post(reverse("booking-new"), times, **JSON).status_code == 200
    times = typed(midnight - timedelta(minutes=30), midnight + timedelta(minutes=5), robot=robot.slug)
    answer = signed_in(stranger).post(reverse("booking-new"), times, **JSON)
    assert "role_too_low" in [refusal["code"] for refusal in answer.json()["refusals"]]


def test_a_course_that_lets_people_only_watch_lends_no_quota(signed_in, robot, course, stranger):
    guests = Course.objects.create(
        name="Guests", slug="guests", role=Role.OBSERVER, starts_on=course.starts_on, ends_on=course.ends_on
    )
    guests.robots.add(robot)
    Enrolment.objects.create(course=guests, person=stranger)
    signed_in(stranger).post(reverse("booking-new"), fields(robot, 1), **JSON)
    assert Booking.objects.get().course == course
    answer = signed_in(stranger).post(reverse("booking-new"), fields(robot, 2), **JSON)
    assert [refusal["code"] for refusal in answer.json()["refusals"]] == ["quota_course_open"]


# --- a slot that runs ------------------------------------------------------------------------------


def test_a_slot_that_runs_does_not_end_in_the_past(signed_in, robot, operator):
    booking = stored(robot, operator, -110, 10, used_at=minutes(-110))
    times = typed(booking.starts_at, minutes(-80))
    assert change(signed_in(operator), booking, **times) == ["in_past"]
    assert booking.held_until == minutes(10)  # unchanged: the quota counts the used time


def test_notice_is_asked_for_the_start_only(signed_in, robot, operator):
    Policy.objects.create(robot=robot, notice_min=60)
    booking = stored(robot, operator, -30, 10, used_at=minutes(-30))
    assert change(signed_in(operator), booking, **typed(booking.starts_at, minutes(25))) == []
    assert change(
        signed_in(operator), stored(robot, operator, 30, 40), **typed(minutes(35), minutes(50))
    ) == ["short_notice"]


def test_a_slot_in_use_is_handed_to_a_colleague_who_can_use_it(signed_in, robot, operator, second_operator):
    booking = stored(robot, operator, -60, 60, used_at=minutes(-60))
    assert change(signed_in(operator), booking, "hand", to=second_operator.username) == []
    accept(signed_in(second_operator))
    booking.refresh_from_db()
    rest = Booking.objects.get(person=second_operator)
    assert (stage(rest), rest.ends_at) == (Stage.DUE, minutes(60))
    assert (booking.person, stage(booking)) == (operator, Stage.FINISHED)  # the time that has passed


# --- notice to cancel ------------------------------------------------------------------------------


def test_moving_is_no_way_to_cancel_late(signed_in, robot, operator, supervisor):
    Policy.objects.create(robot=robot, cancel_notice_min=24 * 60)
    booking = stored(robot, operator, 60, 120)
    browser = signed_in(operator)
    assert change(browser, booking, "cancel") == ["late_to_cancel"]
    assert change(browser, booking, **typed(minutes(3000), minutes(3060))) == ["late_to_cancel"]
    assert change(browser, booking, **typed(booking.starts_at, minutes(80))) == ["late_to_cancel"]
    assert change(browser, booking, **typed(booking.starts_at, minutes(150))) == []  # no time is given up
    assert change(signed_in(supervisor), booking, **typed(minutes(3000), minutes(3060))) == []


# --- approval --------------------------------------------------------------------------------------


@pytest.fixture
def approved(robot, operator, supervisor):
    Policy.objects.create(robot=robot, needs_approval=True)
    slot = Slot(in_hours(5), in_hours(6))
    booking = booking_make(robot=robot, person=operator, slot=slot, now=timezone.now())
    assert booking.state == State.AWAITING
    booking_approve(booking_id=booking.pk, version=1, actor=supervisor, now=timezone.now())
    booking.refresh_from_db()
    return booking


def test_a_moved_booking_awaits_approval_again(signed_in, robot, approved, operator, supervisor):
    browser = signed_in(operator)
    change(browser, approved, **typed(in_hours(5), in_hours(5) + timedelta(minutes=30)))
    assert approved.state == State.BOOKED  # inside the approved slot
    change(browser, approved, **fields(robot, 8))
    assert (approved.starts_at, approved.state) == (in_hours(8), State.AWAITING)
    change(signed_in(supervisor), approved, "approve")
    change(signed_in(supervisor), approved, **fields(robot, 9))
    assert approved.state == State.BOOKED


def test_a_booking_that_moved_meanwhile_is_not_approved(signed_in, robot, approved, operator, supervisor):
    change(signed_in(operator), approved, **fields(robot, 8))
    seen = approved.version
    change(signed_in(operator), approved, **fields(robot, 9))
    approved.version, page = seen, signed_in(supervisor)
    assert change(page, approved, "approve") == ["changed"]
    assert change(page, approved, "approve") == []


def test_a_booking_in_other_hands_awaits_approval_again(signed_in, approved, operator, second_operator):
    change(signed_in(operator), approved, "hand", to=second_operator.username)
    accept(signed_in(second_operator))
    approved.refresh_from_db()
    assert (approved.person, approved.state) == (second_operator, State.AWAITING)


def test_an_accepted_offer_awaits_approval(robot, approved, operator, second_operator):
    slot, now = Slot(in_hours(5), in_hours(6)), timezone.now()
    waiting_join(robot=robot, person=second_operator, slot=slot, now=now)
    booking_cancel(booking_id=approved.pk, version=approved.version, actor=operator, now=now)
    keep_waiting_lists(now)
    offer = Booking.objects.get(state=State.OFFERED)
    offer_accept(booking_id=offer.pk, actor=second_operator, now=now)
    offer.refresh_from_db()
    assert offer.state == State.AWAITING


def test_an_unapproved_booking_blocks_nobody_after_the_grace(signed_in, robot, operator, second_operator):
    forgotten = stored(robot, second_operator, -20, 100, state=State.AWAITING)
    times = typed(minutes(20), minutes(60), robot=robot.slug)
    assert signed_in(operator).post(reverse("booking-new"), times, **JSON).status_code == 200
    forgotten.refresh_from_db()
    held = forgotten.held_until - forgotten.starts_at
    assert (forgotten.state, held) == (State.CANCELLED, timedelta(minutes=15))


# --- the hour that the clock shows twice ---


def test_lengthening_in_a_repeated_hour_keeps_the_start(signed_in, robot, operator):
    Policy.objects.create(robot=robot, horizon_days=730)
    operator.time_zone = "Europe/Berlin"
    operator.save()
    last = datetime(timezone.now().year + 1, 10, 31, tzinfo=UTC)
    sunday = last - timedelta(days=last.isoweekday() % 7)  # 03:00 becomes 02:00 at 01:00 UTC
    day = sunday.date()
    starts, ends = sunday + timedelta(minutes=75), sunday + timedelta(minutes=105)
    times = {"starts_at": starts, "ends_at": ends, "held_until": ends, "made_at": timezone.now()}
    booking = Booking.objects.create(robot=robot, person=operator, **times)
    browser = signed_in(operator)
    assert change(browser, booking, starts_at=f"{day}T02:15", ends_at=f"{day}T03:30") == []
    assert (booking.starts_at, booking.ends_at) == (starts, sunday + timedelta(minutes=150))
    assert change(browser, booking, starts_at=f"{day}T02:15", ends_at=f"{day}T03:00") == []
    assert (booking.starts_at, booking.ends_at) == (starts, sunday + timedelta(minutes=120))


# --- no-show, waiting list, reminder ---------------------------------------------------------------


def test_who_waits_gets_the_rest_of_a_slot_that_nobody_used(robot, operator, second_operator):
    now = timezone.now()
    unused = stored(robot, operator, -5, 120)
    waiting_join(robot=robot, person=second_operator, slot=Slot(minutes(60), minutes(120)), now=now)
    keep_waiting_lists(now + timedelta(minutes=20))
    assert Booking.objects.get(state=State.OFFERED).person == second_operator
    unused.refresh_from_db()
    assert unused.state == State.NO_SHOW


def test_a_moved_booking_is_reminded_of_again(signed_in, robot, operator):
    slot = Slot(in_hours(3), in_hours(4))
    booking = booking_make(robot=robot, person=operator, slot=slot, now=timezone.now())
    write_reminders(in_hours(2.5))
    booking.refresh_from_db()
    assert booking.reminded_at
    change(signed_in(operator), booking, **fields(robot, 30))
    assert booking.reminded_at is None


# --- times at the ends of the calendar -------------------------------------------------------------


@pytest.fixture(params=["Europe/Berlin", "America/New_York"])
def browser(request, signed_in, robot, operator):
    """A browser of a person in this zone; the robot has all kinds of limits."""
    operator.time_zone = request.param
    operator.save()
    limits = {"day_min": 600, "week_min": 600, "at_once": 5, "gap_min": 5}
    Policy.objects.create(robot=robot, opening={"mon": [["08:00", "20:00"]]}, **limits)
    return signed_in(operator)


@pytest.mark.parametrize("days", [("0001-01-01", "0001-01-08"), ("9999-12-25", "9999-12-31")])
def test_days_at_the_ends_of_the_calendar(browser, days):
    assert browser.get(reverse("bookings"), {"day": days[0]}).status_code == 200
    assert browser.get(reverse("bookings"), {"day": days[1]}).status_code == 200
    assert (
        browser.get(reverse("bookings-feed"), dict(zip(("start", "end"), days, strict=True))).status_code
        == 400
    )


def test_two_hundred_years_of_the_calendar_are_not_computed(browser):
    answer = browser.get(reverse("bookings-feed"), {"start": "2000-01-01", "end": "2199-12-31"})
    assert len(answer.json()["events"]) < 100


@pytest.mark.parametrize(
    ("starts", "ends"),
    [
        ("0001-01-01T00:00", "2026-01-01T00:00"),
        ("9999-12-31T20:00", "9999-12-31T23:59"),
        ("0001-01-01T00:00", "0001-01-01T01:00"),
        ("0001-01-09T00:00", "9999-12-30T00:00"),
        ("2000-01-01T00:00", "2030-01-01T00:00"),
        ("2199-01-01T00:00", "2199-12-31T23:59"),
    ],
)
def test_times_beyond_all_reason_are_refused_in_words_and_soon(browser, robot, starts, ends):
    begun_s = time.monotonic()
    for page in ("booking-new", "bookings-waiting"):
        answer = browser.post(
            reverse(page), {"robot": robot.slug, "starts_at": starts, "ends_at": ends}, **JSON
        )
        assert (answer.status_code, len(answer.json()["refusals"]) > 0) == (409, True)
    assert time.monotonic() - begun_s < 5.0


def test_characters_that_postgresql_refuses(signed_in, robot, operator):
    browser = signed_in(operator)
    assert change(browser, stored(robot, operator, 60, 120), "hand", to="a\0") == ["no_colleague"]
    assert change(browser, stored(robot, operator, 180, 240), "cancel", reason="a\0b") == []
    assert browser.post(reverse("bookings-address"), {"robot": "a\0"}).status_code == 404
    days = {"start": "2026-03-02", "end": "2026-03-09", "robot": "a\0"}
    assert browser.get(reverse("bookings-feed"), days).json()["resources"] == []
    assert browser.get("/join/a%00b/").status_code == 410
