"""Wrong times in every form and request with times: each is refused with text and code; nothing is stored."""

import re
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from django.urls import reverse
from django.utils import timezone as django_timezone

from fleet.bookings.models import Booking, OutOfService, Policy, Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment

pytestmark = pytest.mark.django_db

ZONE = "Europe/Madrid"
SKIPPED = "2027-03-28T02:30"  # clocks go from 02:00 to 03:00 that night
TWICE = "2027-10-31T02:30"  # clocks go from 03:00 back to 02:00 that night
JSON = {"HTTP_ACCEPT": "application/json"}
HTML = {"HTTP_ACCEPT": "text/html"}

# Code and times; numbers are hours from the next full hour.
WRONG = {
    "in_past": (-2, -1),
    "zero_length": (2, 2),
    "backwards": (3, 2),
    "too_long": (2, 24 * 9),
    "too_far": (24 * 4000, 24 * 4000 + 1),
    "time_gap": (SKIPPED, "2027-03-28T04:00"),
    "wrong_year": ("12026-03-02T10:00", "12026-03-02T11:00"),
}
EXTREMES = ["0001-01-01T00:00", "9999-12-31T23:59", "275760-09-13T00:00"]
wrong_times = pytest.mark.parametrize(("code", "times"), WRONG.items())


@pytest.fixture(params=["operator", "supervisor"])
def browser(request, robot, signed_in):
    """The browser of a person whose time zone is that of Madrid."""
    person = request.getfixturevalue(request.param)
    person.time_zone = ZONE
    person.save()
    return signed_in(person)


@pytest.fixture
def booking(robot, browser, operator):
    """A booking of the operator, tomorrow."""
    starts = hour() + timedelta(days=1)
    slot = Slot(starts, starts + timedelta(hours=1))
    return booking_make(robot=robot, person=operator, slot=slot, now=django_timezone.now())


def hour():
    now = django_timezone.now().replace(minute=0, second=0, microsecond=0)
    return now.astimezone(ZoneInfo(ZONE)) + timedelta(hours=1)


def typed(time):
    return time if isinstance(time, str) else f"{hour() + timedelta(hours=time):%Y-%m-%dT%H:%M}"


def fields(robot, times, **others):
    return {"robot": robot.slug, "starts_at": typed(times[0]), "ends_at": typed(times[1]), **others}


def codes(answer):
    return [refusal["code"] for refusal in answer.json()["refusals"]]


@wrong_times
def test_booking_by_form_and_by_script(browser, robot, code, times):
    page = browser.post(reverse("booking-new"), fields(robot, times), **HTML)
    assert (page.status_code, f'data-code="{code}"' in page.content.decode()) == (409, True)
    assert code in codes(browser.post(reverse("booking-new"), fields(robot, times), **JSON))
    assert not Booking.objects.exists()


@wrong_times
def test_moving_by_form_and_by_script(browser, robot, booking, code, times):
    address = reverse("booking", args=[booking.pk])
    move = fields(robot, times, action="move", version=booking.version)
    page = browser.post(address, move, **HTML)
    assert (page.status_code, f'data-code="{code}"' in page.content.decode()) == (409, True)
    assert code in codes(browser.post(address, move, **JSON))
    unchanged = Booking.objects.get()
    assert (unchanged.starts_at, unchanged.version) == (booking.starts_at, booking.version)


@wrong_times
def test_waiting_for_a_slot(browser, robot, code, times):
    assert code in codes(browser.post(reverse("bookings-waiting"), fields(robot, times), **JSON))
    assert not Waiting.objects.exists()


def test_nobody_joins_a_waiting_list_for_others(signed_in, supervisor, operator, robot):
    asked = fields(robot, (2, 3), person=operator.username)
    assert codes(signed_in(supervisor).post(reverse("bookings-waiting"), asked, **JSON)) == ["not_for_others"]
    assert not Waiting.objects.exists()


@wrong_times
def test_a_series_shows_each_refusal_and_books_nothing(client, supervisor, robot, code, times):
    supervisor.time_zone = ZONE
    supervisor.save()
    client.force_login(supervisor)
    form = fields(robot, times, weeks=1, purpose="HRI")
    page = client.post(reverse("booking-series"), {**form, "action": "preview"}).content.decode()
    words = {
        "in_past": "begins in the past",
        "zero_length": "has no length",
        "backwards": "ends before it begins",
        "too_long": "lasts at most",
        "too_far": "more than ten years ahead",
        "time_gap": "02:30 does not exist on 28 Mar 2027",
        "wrong_year": "Look at the year",
    }
    assert words[code] in page
    client.post(reverse("booking-series"), {**form, "action": "book"})
    assert not Booking.objects.exists()


@pytest.mark.parametrize("times", [(3, 2), (2, 2), (SKIPPED, 1), (2, SKIPPED), ("12026-03-02T10:00", "")])
def test_an_out_of_service_period(client, supervisor, robot, times):
    supervisor.time_zone = ZONE
    supervisor.save()
    client.force_login(supervisor)
    answer = client.post(reverse("out-of-service"), fields(robot, times, why="repair"))
    said = answer.content.decode()
    words = ("ends before it begins", "does not exist on 28 Mar 2027", "Look at the year")
    assert any(part in said for part in words)
    assert not OutOfService.objects.exists()


def test_a_person_chooses_one_of_the_two_moments_of_a_repeated_time(browser, robot):
    Policy.objects.create(horizon_days=730)
    refused = browser.post(reverse("booking-new"), fields(robot, (TWICE, "2027-10-31T03:30")), **JSON).json()
    assert [one["code"] for one in refused["refusals"]] == ["time_twice"]
    assert "comes twice, because clocks go back: choose UTC+2 or UTC+1" in refused["refusals"][0]["text"]
    first, second = refused["alternatives"]
    assert "02:30 (UTC+2) to 03:30" in first["words"]
    assert (second["start"], second["end"]) == (f"{TWICE}+01:00", "2027-10-31T03:30")
    form = browser.get(
        reverse("booking-new"), {"from": second["start"], "to": second["end"]}
    ).content.decode()
    assert f'value="{TWICE}"' in form and "02:30: UTC+1" in form
    kept = {"starts_at_exact": second["start"], "starts_at": TWICE, "ends_at": second["end"]}
    page = browser.post(reverse("booking-new"), {"robot": robot.slug, **kept}, follow=True, **HTML)
    booking = Booking.objects.get()
    assert (booking.starts_at, booking.ends_at - booking.starts_at) == (
        datetime(2027, 10, 31, 1, 30, tzinfo=UTC),
        timedelta(hours=1),
    )
    assert "02:30 (UTC+1) to 03:30" in page.content.decode()
    days = {"start": "2027-10-31", "end": "2027-11-01"}
    events = browser.get(reverse("bookings-feed"), days).json()["events"]
    named = [one["extendedProps"]["times"] for one in events if one["id"] == str(booking.pk)]
    assert named == ["02:30 (UTC+1) - 03:30"]


@pytest.mark.parametrize(
    ("view", "sent"),
    [
        ("booking-new", {"override": "clocks"}),
        ("out-of-service", {"why": "repair"}),
        ("booking-series", {"weeks": 1, "purpose": "HRI", "action": "book", "override": "clocks"}),
    ],
)
def test_each_form_asks_which_of_two_moments(view, sent, client, staff, robot):
    staff.time_zone = ZONE
    staff.save()
    client.force_login(staff)
    form = {**fields(robot, (TWICE, "2027-10-31T03:30")), **sent, "robots": robot.slug}
    page = client.post(reverse(view), form, **HTML).content.decode()
    assert "comes twice, because clocks go back" in page
    options = re.findall(r'<option value="([^"]+)">(UTC[^<]+)<', page)
    assert options == [(f"{TWICE}+02:00", "UTC+2"), (f"{TWICE}+01:00", "UTC+1")]
    made = OutOfService if view == "out-of-service" else Booking
    assert not made.objects.exists()
    client.post(reverse(view), {**form, "starts_at_exact": options[1][0]}, **HTML)
    assert made.objects.get().starts_at == datetime(2027, 10, 31, 1, 30, tzinfo=UTC)


def test_a_time_typed_over_a_repeated_one_counts_alone(browser, robot):
    later = (hour() + timedelta(days=1)).replace(hour=9)
    other = {"starts_at_exact": f"{TWICE}+01:00", "starts_at": f"{later:%Y-%m-%dT%H:%M}"}
    ends = {"ends_at": f"{later + timedelta(hours=1):%Y-%m-%dT%H:%M}"}
    browser.post(reverse("booking-new"), {"robot": robot.slug, **other, **ends})
    assert Booking.objects.get().starts_at == later


def test_both_ends_of_a_slot_may_come_twice(browser, robot):
    Policy.objects.create(horizon_days=730)
    times = ("2027-10-31T02:00", TWICE)
    refused = browser.post(reverse("booking-new"), fields(robot, times), **JSON).json()
    assert [one["words"].partition(", 02")[2] for one in refused["alternatives"]] == [
        ":00 (UTC+2) to 02:30 (UTC+2)",
        ":00 (UTC+2) to 02:30 (UTC+1)",
        ":00 (UTC+1) to 02:30 (UTC+1)",
    ]
    booking_of_an_hour = fields(robot, (2, 3))
    browser.post(reverse("booking-new"), booking_of_an_hour)
    booking = Booking.objects.get()
    move = fields(robot, times, action="move", version=1)
    moved = browser.post(reverse("booking", args=[booking.pk]), move, **JSON).json()
    assert [one["code"] for one in moved["refusals"]] == ["time_twice"] * 2
    third = moved["alternatives"][2]
    chosen = {"starts_at": third["start"], "ends_at": third["end"]}
    assert browser.post(reverse("booking", args=[booking.pk]), {**move, **chosen}, **JSON).status_code == 200
    booking.refresh_from_db()
    assert booking.starts_at == datetime(2027, 10, 31, 1, tzinfo=UTC)


@pytest.mark.parametrize("zone", ["Pacific/Kiritimati", "America/Los_Angeles"])
def test_the_ends_of_the_calendar_break_no_page(client, robot, stranger, zone):
    """Sums of such times overflow. The quotas of a slot of 1000 years once took minutes and gigabytes."""
    Policy.objects.create(
        robot=robot, day_min=60, week_min=60, gap_min=60, opening={"mon": [["08:00", "20:00"]]}
    )
    days = {"starts_on": "2026-01-01", "ends_on": "9999-12-31"}
    course = Course.objects.create(name="HRI", slug="hri", day_min=60, course_week_min=60, **days)
    course.robots.add(robot)
    Enrolment.objects.create(course=course, person=stranger)
    stranger.time_zone = zone
    stranger.save()
    client.force_login(stranger)
    for starts in EXTREMES:
        for ends in (*EXTREMES, typed(1)):
            form = fields(robot, (starts, ends))
            assert client.post(reverse("booking-new"), form).status_code == 409
            assert client.post(reverse("bookings-waiting"), form).status_code == 409
            assert client.get(reverse("bookings-feed"), {"start": starts, "end": ends}).status_code == 400
        assert client.get(reverse("bookings"), {"day": starts}).status_code == 200
        assert client.get(reverse("booking-new"), {"from": starts, "to": starts}).status_code == 200
    assert (
        client.post(
            reverse("booking-new"), fields(robot, ("2000-01-01T00:00", "2199-12-31T00:00"))
        ).status_code
        == 409
    )


def test_handing_to_nobody_has_a_code(browser, booking):
    answer = browser.post(
        reverse("booking", args=[booking.pk]), {"action": "hand", "version": 1, "to": "nobody"}, **JSON
    )
    assert (answer.status_code, codes(answer)) == (409, ["no_colleague"])
