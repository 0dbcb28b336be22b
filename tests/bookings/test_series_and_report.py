"""Weekly series and the report of hours, through their pages."""

import codecs
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from uuid import uuid4
from zoneinfo import ZoneInfo

import pytest
from django.urls import reverse
from django.utils import timezone as django_timezone

from fleet.accounts.models import User
from fleet.bookings.changes.series import preview, series_make, weekly
from fleet.bookings.hours.report import Row, lines, report
from fleet.bookings.models import Booking, Policy
from fleet.bookings.pages.calendar import span
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make
from robots.access.models import Course, Enrolment
from robots.shared.wire import Refusal
from tests.bookings.support import accept

pytestmark = pytest.mark.django_db

MADRID = ZoneInfo("Europe/Madrid")


def test_a_series_keeps_the_wall_clock_over_daylight_saving():
    first = Slot(datetime(2026, 3, 23, 9, tzinfo=UTC), datetime(2026, 3, 23, 10, tzinfo=UTC))
    slots = weekly(first, 3, [date(2026, 3, 30)], MADRID)
    assert [day for day, _ in slots] == [date(2026, 3, 23), date(2026, 4, 6)]
    assert slots[1][1].starts_at == datetime(2026, 4, 6, 8, tzinfo=UTC)


def test_a_week_whose_time_is_skipped_is_a_refusal():
    first = Slot(datetime(2026, 3, 22, 1, 30, tzinfo=UTC), datetime(2026, 3, 22, 2, tzinfo=UTC))
    [_, (_, skipped)] = weekly(first, 2, [], MADRID)
    assert isinstance(skipped, Refusal)
    assert skipped.code == "time_gap"


@pytest.fixture
def madrid(settings):
    """The lab is in Madrid."""
    settings.TIME_ZONE = "Europe/Madrid"


def on_the_wall(slots):
    return {
        (f"{slot.starts_at.astimezone(MADRID):%H:%M}", f"{slot.ends_at.astimezone(MADRID):%H:%M}")
        for slot in slots
    }


@pytest.mark.parametrize(
    ("starts", "ends"),
    [
        ("2027-03-27T22:00", "2027-03-28T06:00"),  # the first night itself has 7 hours
        ("2027-03-20T22:00", "2027-03-21T06:00"),
        ("2027-10-23T22:00", "2027-10-24T06:00"),
        ("2027-10-30T22:00", "2027-10-31T06:00"),  # 9 hours
        ("2027-03-07T23:30", "2027-03-08T00:30"),
        ("2027-03-14T00:00", "2027-03-15T00:00"),  # a whole day
    ],
)
def test_begin_and_end_keep_their_times_of_day(madrid, starts, ends):
    first = Slot(
        *(datetime.fromisoformat(time).replace(tzinfo=MADRID).astimezone(UTC) for time in (starts, ends))
    )
    slots = [slot for _, slot in weekly(first, 30, [])]
    assert slots[0] == first
    assert on_the_wall(slots) == {(starts[-5:], ends[-5:])}
    assert {(b.starts_at - a.starts_at) % timedelta(days=7) for a, b in pairwise(slots)} <= {
        timedelta(0),
        timedelta(hours=1),
        timedelta(days=7) - timedelta(hours=1),
    }


def test_an_end_that_the_clock_skips_is_a_refusal(madrid):
    starts = datetime(2027, 3, 20, 21, tzinfo=UTC)
    slots = weekly(Slot(starts, starts + timedelta(hours=4.5)), 3, [])  # until 02:30
    assert [getattr(slot, "code", None) for _, slot in slots] == [None, "time_gap", None]


def test_of_an_end_that_the_clock_shows_twice_the_first_counts(madrid):
    starts = datetime(2027, 10, 23, 20, tzinfo=UTC)
    [_, (_, slot)] = weekly(Slot(starts, starts + timedelta(hours=4.5)), 2, [])
    assert slot.ends_at == datetime(2027, 10, 31, 0, 30, tzinfo=UTC)


@pytest.mark.parametrize(
    ("zone", "starts", "ends", "hours"),
    [
        (
            "Australia/Lord_Howe",
            "2026-09-27T01:00",
            "2026-09-27T03:00",
            [2, 1.5, 2],
        ),  # the clock skips half an hour
        ("Australia/Lord_Howe", "2027-03-28T01:00", "2027-03-28T03:00", [2, 2.5, 2]),
        ("Asia/Beirut", "2027-03-20T20:00", "2027-03-21T00:00", [4, 4, 4]),  # the clock skips 00:00
        ("Asia/Beirut", "2027-03-21T00:00", "2027-03-21T02:00", [2, "time_gap", 2]),
        ("America/Santiago", "2026-08-29T22:00", "2026-08-30T02:00", [4, 3, 4]),
        ("America/Santiago", "2027-03-27T22:00", "2027-03-28T02:00", [4, 5, 4]),
        ("Europe/Madrid", "2027-03-21T01:00", "2027-03-21T02:00", [1, 1, 1]),  # until the change itself
        ("Europe/Madrid", "2026-12-28T22:00", "2026-12-29T06:00", [8, 8, 8]),
    ],
)
def test_a_series_lasts_as_its_zones_clock_says(zone, starts, ends, hours):
    of = ZoneInfo(zone)
    first = Slot(*(datetime.fromisoformat(time).replace(tzinfo=of) for time in (starts, ends)))
    found = [slot for _, slot in weekly(first, 3, [], of)]
    real = [slot.code if isinstance(slot, Refusal) else slot.shared_minutes(slot) / 60 for slot in found]
    assert real == hours


def test_the_calendar_draws_a_slot_in_an_hour_that_comes_twice():
    early, late = (
        datetime(2027, 10, 31, 2, minute, fold=fold, tzinfo=MADRID).astimezone(UTC)
        for minute, fold in ((45, 0), (15, 1))
    )
    assert span(early, late, MADRID) == ("2027-10-31T02:45:00", "2027-10-31T03:15:00")
    assert span(early, early + timedelta(hours=2), MADRID) == ("2027-10-31T02:45:00", "2027-10-31T03:45:00")


def test_a_series_keeps_the_labs_clock_whoever_books(madrid, client, robot, supervisor):
    Policy.objects.create(robot=robot, horizon_days=730, longest_min=600, robots_at_once=9)
    supervisor.time_zone = "America/New_York"
    supervisor.save()
    client.force_login(supervisor)
    fields = {
        "robot": robot.slug,
        "starts_at": "2027-03-27T17:00",
        "ends_at": "2027-03-28T00:00",
        "weeks": 4,
        "purpose": "nights",
    }
    page = client.post(reverse("booking-series"), {**fields, "action": "preview"}).content.decode()
    assert "Sat 27 Mar 2027, 17:00 to Sun 28 Mar 2027, 00:00" in page
    assert "Sat 03 Apr 2027, 16:00 to Sun 04 Apr 2027, 00:00" in page
    client.post(reverse("booking-series"), {**fields, "action": "book"})
    made = Booking.objects.filter(person=supervisor)
    assert (made.count(), on_the_wall(made)) == (4, {("22:00", "06:00")})


def test_a_series_shows_conflicts_and_books_the_rest(client, robot, supervisor, operator):
    starts = django_timezone.now().replace(minute=0, second=0, microsecond=0) + timedelta(hours=2)
    second = starts + timedelta(weeks=1)
    booking_make(
        robot=robot,
        person=operator,
        slot=Slot(second, second + timedelta(minutes=30)),
        now=django_timezone.now(),
    )
    client.force_login(supervisor)
    fields = {
        "robot": robot.slug,
        "starts_at": f"{starts:%Y-%m-%dT%H:%M}",
        "ends_at": f"{starts + timedelta(hours=1):%Y-%m-%dT%H:%M}",
        "weeks": 3,
        "purpose": "HRI",
        "record": "on",
    }
    page = client.post(reverse("booking-series"), {**fields, "action": "preview"}).content.decode()
    assert "checked" in page.split('name="record"')[1].split(">")[0]
    assert "Olga Operator has booked" in page
    assert Booking.objects.count() == 1
    client.post(reverse("booking-series"), {**fields, "action": "book"})
    made = Booking.objects.filter(person=supervisor)
    assert (made.count(), made.values("series").distinct().count()) == (2, 1)
    assert [one.record for one in made] == [True, True]
    address = reverse("booking-whole-series", args=[made[0].series])
    assert "from the first control in it" in client.get(address).content.decode()


def test_a_preview_counts_the_weeks_before_as_the_booking_does(robot, supervisor):
    Policy.objects.create(robot=robot, at_once=2)
    now = django_timezone.now()
    slots = weekly(Slot(now + timedelta(hours=2), now + timedelta(hours=3)), 3, [], MADRID)
    asked = {"robot": robot, "person": supervisor, "slots": slots, "now": now}
    shown = preview(**asked, override=False, lesson=False)
    assert [[one.code for one in week.refusals] for week in shown] == [[], [], ["quota_open"]]
    made, left = series_make(**asked, actor=supervisor, purpose="HRI", override="")
    assert (len(made), [one.code for week in left for one in week.refusals]) == (2, ["quota_open"])


def test_a_series_has_a_courses_lessons_and_the_report_its_term(client, robot, staff):
    now = django_timezone.now()
    today = now.date()
    course = Course.objects.create(
        name="HRI",
        slug="hri",
        role="operator",
        starts_on=today,
        ends_on=today + timedelta(days=60),
        course_week_min=30,
    )
    course.robots.add(robot)
    student = User.objects.create_user("stu")
    Enrolment.objects.create(course=course, person=student)
    starts = now.replace(minute=0, second=0, microsecond=0) + timedelta(hours=2)
    client.force_login(staff)
    fields = {
        "robot": robot.slug,
        "starts_at": f"{starts:%Y-%m-%dT%H:%M}",
        "ends_at": f"{starts + timedelta(hours=1):%Y-%m-%dT%H:%M}",
        "weeks": 3,
        "course": "hri",
        "purpose": "Lesson",
        "action": "book",
    }
    client.post(reverse("booking-series"), fields)
    assert Booking.objects.filter(course=course, person=staff).count() == 3
    slot = Slot(starts + timedelta(hours=1), starts + timedelta(hours=1.5))
    booking_make(robot=robot, person=student, slot=slot, now=now)  # lessons use no quota of students
    answer = client.get(reverse("booking-report"), {"as": "csv", "by": "course", "course": "hri"})
    assert answer.content.startswith(codecs.BOM_UTF8)  # for Excel
    assert answer.content.decode().splitlines()[1].startswith("HRI,4,3.50,")


def test_the_report_shows_one_robot_or_person(
    signed_in, robot, other_robot, operator, second_operator, staff
):
    now = django_timezone.now()
    for where, who, hours in ((robot, operator, 1), (robot, second_operator, 2), (other_robot, operator, 3)):
        starts = now - timedelta(days=hours)
        ends = starts + timedelta(hours=hours)
        times = {"starts_at": starts, "ends_at": ends, "held_until": ends, "made_at": starts}
        Booking.objects.create(robot=where, person=who, **times, used_at=starts)

    def hours_booked(**only):
        answer = signed_in(staff).get(reverse("booking-report"), {"as": "csv", **only})
        return [row.split(",")[2] for row in answer.content.decode().splitlines()[1:]]

    assert hours_booked() == ["3.00", "3.00"]
    assert hours_booked(robot=robot.slug, by="person") == ["2.00", "1.00"]
    assert hours_booked(person="olga", by="person") == ["4.00"]
    assert hours_booked(person="olga", robot=other_robot.slug) == ["3.00"]


def test_the_report_sums_hours_and_slots_not_used(client, robot, operator, supervisor):
    now = django_timezone.now()
    for days, used in ((3, True), (2, True), (1, False)):
        starts = now - timedelta(days=days)
        Booking.objects.create(
            robot=robot,
            person=operator,
            starts_at=starts,
            ends_at=starts + timedelta(hours=2),
            held_until=starts + timedelta(hours=1.5),
            used_at=starts if used else None,
            made_at=starts,
        )
    [row] = report([robot], (), starts=now - timedelta(days=7), ends=now, by="person", now=now)
    assert (row.name, row.bookings, row.booked_h, row.used_h, row.not_used) == ("Olga Operator", 3, 6, 3, 1)
    client.force_login(supervisor)
    answer = client.get(reverse("booking-report"), {"as": "csv", "by": "course"})
    assert answer.content.decode().splitlines()[1] == "-,3,6.00,3.00,1,0"
    client.force_login(operator)
    assert client.get(reverse("booking-report")).status_code == 403


def test_the_report_counts_a_slot_as_not_used_as_soon_as_it_is_free(robot, operator):
    now = django_timezone.now()
    times = {"starts_at": now - timedelta(minutes=14), "ends_at": now + timedelta(hours=2)}
    Booking.objects.create(
        robot=robot, person=operator, **times, held_until=times["ends_at"], made_at=times["starts_at"]
    )
    span = {"starts": now - timedelta(days=7), "ends": now, "by": "robot"}
    assert report([robot], (), **span, now=now)[0].not_used == 0
    assert report([robot], (), **span, now=now + timedelta(minutes=2))[0].not_used == 1


def test_a_name_is_no_formula_in_a_spreadsheet(robot, operator):
    operator.full_name = "=1+1"
    operator.save()
    starts = django_timezone.now()
    slot = Slot(starts, starts + timedelta(hours=1))
    booking_make(robot=robot, person=operator, slot=slot, now=starts)
    rows = report(
        [robot],
        (),
        starts=starts - timedelta(days=1),
        ends=starts + timedelta(days=1),
        by="person",
        now=starts,
    )
    assert lines(rows)[1][0] == "'=1+1"


def test_no_name_in_the_report_begins_as_a_formula():
    rows = [Row("\uff1d1+1"), Row("\n=1"), Row("-")]
    assert [line[0] for line in lines(rows)[1:]] == ["'\uff1d1+1", "'\n=1", "-"]


def test_two_people_of_one_name_are_two_rows(client, robot, operator, second_operator, supervisor):
    second_operator.full_name = operator.full_name
    second_operator.save()
    for number, person in enumerate((operator, second_operator)):
        starts = django_timezone.now() + timedelta(hours=number)
        slot = Slot(starts, starts + timedelta(hours=1))
        booking_make(robot=robot, person=person, slot=slot, now=starts)
    client.force_login(supervisor)
    answer = client.get(reverse("booking-report"), {"as": "csv", "by": "person", "to": "2199-01-01"})
    assert [line.split(",")[:2] for line in answer.content.decode().splitlines()[1:]] == [
        ["Olga Operator", "1"],
        ["Olga Operator", "1"],
    ]


def test_a_moved_lesson_stays_one_but_not_in_a_students_hands(signed_in, robot, staff):
    today = django_timezone.now().date()
    days = {"starts_on": today, "ends_on": today + timedelta(days=60)}
    course = Course.objects.create(name="HRI", slug="hri", role="operator", at_once=1, **days)
    course.robots.add(robot)
    student = User.objects.create_user("stu")
    Enrolment.objects.create(course=course, person=student)
    starts = django_timezone.now().replace(minute=0, second=0, microsecond=0) + timedelta(hours=2)
    slot = Slot(starts, starts + timedelta(hours=1))
    lesson = booking_make(
        robot=robot, person=staff, slot=slot, now=django_timezone.now(), series=uuid4(), lesson_of=course
    )
    page, times = (
        signed_in(staff),
        {"starts_at": starts + timedelta(hours=3), "ends_at": starts + timedelta(hours=4)},
    )
    typed = {name: f"{at:%Y-%m-%dT%H:%M}" for name, at in times.items()}
    page.post(reverse("booking", args=[lesson.pk]), {"action": "move", "version": 1, **typed})
    lesson.refresh_from_db()
    assert (lesson.starts_at, lesson.course) == (times["starts_at"], course)
    page.post(reverse("booking", args=[lesson.pk]), {"action": "hand", "version": 2, "to": "stu"})
    accept(signed_in(student))
    lesson.refresh_from_db()
    assert (lesson.person, lesson.course, lesson.series) == (student, course, None)
    with pytest.raises(BookingRefused, match="may have 1 booking to come"):
        booking_make(robot=robot, person=student, slot=slot, now=django_timezone.now())
