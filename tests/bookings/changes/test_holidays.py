"""Holidays of the lab: through their page, a calendar file, and what they do to bookings."""

import re
from datetime import UTC, date, datetime, timedelta

import pytest
from django.core.exceptions import ValidationError
from django.core.files.uploadedfile import SimpleUploadedFile
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.changes.holiday_files import last_read, read_file
from fleet.bookings.changes.holidays import Entry, holidays_add
from fleet.bookings.free_time import free_slots
from fleet.bookings.models import Booking, Change, Holiday
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make

pytestmark = pytest.mark.django_db

FILE = """BEGIN:VCALENDAR
VERSION:2.0
PRODID:-//Lab//EN
BEGIN:VEVENT
UID:1
DTSTART;VALUE=DATE:{first}
DTEND;VALUE=DATE:{end}
SUMMARY:Winter break
END:VEVENT
BEGIN:VEVENT
UID:2
DTSTART;VALUE=DATE:20200501
RRULE:FREQ=YEARLY
SUMMARY:May Day
END:VEVENT
BEGIN:VEVENT
UID:3
DTSTART:{first}T220000Z
DTEND:{first}T230000Z
SUMMARY:Late in UTC
END:VEVENT
BEGIN:VEVENT
UID:4
DTSTART;VALUE=DATE:20200101
SUMMARY:Over
END:VEVENT
BEGIN:VEVENT
UID:5
DTSTART;VALUE=DATE:{first}
STATUS:CANCELLED
SUMMARY:Not any more
END:VEVENT
END:VCALENDAR
"""
FIRST = timezone.now().date() + timedelta(days=10)


def file(first=FIRST):
    return FILE.format(first=f"{first:%Y%m%d}", end=f"{first + timedelta(days=3):%Y%m%d}").encode()


def on(day, hour=10):
    starts = datetime(day.year, day.month, day.day, hour, tzinfo=UTC)
    return Slot(starts, starts + timedelta(hours=1))


@pytest.fixture
def holiday(staff):
    [made] = holidays_add([Entry(FIRST, FIRST + timedelta(days=1), "Winter break")], actor=staff)
    return made


def test_nobody_books_on_a_holiday_but_staff_with_a_reason(robot, operator, staff, holiday):
    now = timezone.now()
    slot = on(holiday.last_day)
    with pytest.raises(BookingRefused) as caught:
        booking_make(robot=robot, person=operator, slot=slot, now=now)
    [refusal] = caught.value.refusals
    assert refusal.code == "holiday"
    days = f"{FIRST:%d %b %Y} to {FIRST + timedelta(days=1):%d %b %Y}"
    assert refusal.text == f"The lab is closed: Winter break, {days}. Choose another day."
    booking_make(robot=robot, person=operator, actor=staff, slot=slot, now=now, override="exam")
    night = Slot(on(holiday.first_day, 0).starts_at - timedelta(minutes=30), on(holiday.first_day, 0).ends_at)
    with pytest.raises(BookingRefused):
        booking_make(robot=robot, person=operator, slot=night, now=now)


def test_the_search_passes_a_holiday(robot, operator, holiday):
    asked = {"robot": robot, "person": operator, "minutes": 60, "now": timezone.now(), "most": 1}
    [(_robot, slot)] = free_slots(after=on(holiday.first_day, 0).starts_at, **asked)
    assert slot == on(holiday.last_day + timedelta(days=1), 0)


def test_the_calendar_draws_it(signed_in, robot, operator, holiday):
    browser = signed_in(operator)
    days = {"start": str(FIRST), "end": str(FIRST + timedelta(days=1))}
    events = browser.get(reverse("bookings-feed"), days).json()["events"]
    assert [one["title"] for one in events if one["classNames"] == ["holiday"]] == ["Winter break"]
    assert "Winter break" in browser.get(reverse("bookings"), {"day": str(FIRST)}).content.decode()


def test_staff_add_and_remove_one_and_others_see_it(signed_in, staff, supervisor):
    browser = signed_in(staff)
    wrong = {"name": "Break", "first_day": str(FIRST), "last_day": str(FIRST - timedelta(days=1))}
    assert "comes before the first" in browser.post(reverse("holidays"), wrong).content.decode()
    browser.post(reverse("holidays"), {**wrong, "last_day": ""})
    made = Holiday.objects.get()
    assert (made.first_day, made.last_day) == (FIRST, FIRST)
    other = signed_in(supervisor)
    assert "Break" in other.get(reverse("holidays")).content.decode()
    assert other.post(reverse("holiday-remove", args=[made.pk])).status_code == 403
    assert other.post(reverse("holidays"), wrong).status_code == 403
    signed_in(staff).post(reverse("holiday-remove", args=[made.pk]))
    assert not Holiday.objects.exists()
    assert set(Record.objects.values_list("kind", flat=True)) >= {"holiday.add", "holiday.remove"}


def test_a_calendar_file_is_shown_before_it_is_added(signed_in, staff, holiday):
    browser = signed_in(staff)
    sent = {"action": "read", "file": SimpleUploadedFile("school.ics", file())}
    shown = browser.post(reverse("holidays"), sent).content.decode()
    assert "1 day of the file is in the list already" in shown
    assert Holiday.objects.count() == 1
    entries = re.findall(r'name="entry" value="([^"]+)"', shown)
    assert [one.split(" ", 2)[2] for one in entries] == ["Late in UTC"] + ["May Day"] * (len(entries) - 1)
    browser.post(reverse("holidays"), {"action": "import", "entry": entries[1:]})
    assert list(Holiday.objects.filter(name="May Day").values_list("last_day__day", flat=True)) == [1] * (
        len(entries) - 1
    )
    assert not Holiday.objects.filter(name="Late in UTC").exists()


def days_of(rule, start="DTSTART;VALUE=DATE:20200101", more=""):
    event = f"BEGIN:VEVENT\nUID:1\n{start}\nRRULE:{rule}\nSUMMARY:Free\nEND:VEVENT\n"
    found, left = read_file(f"BEGIN:VCALENDAR\n{event}{more}END:VCALENDAR".encode())
    return [one.first_day for one in found], left


@pytest.fixture
def at_the_end_of_2026(monkeypatch):
    monkeypatch.setattr("fleet.bookings.changes.holiday_files.lab_date", lambda: date(2026, 11, 30))


@pytest.mark.parametrize(
    ("rule", "start", "days"),
    [
        ("FREQ=YEARLY", "20240229", [date(2028, 2, 29)]),
        ("FREQ=YEARLY;BYMONTH=9;BYDAY=1MO", "20200907", [date(2027, 9, 6), date(2028, 9, 4)]),
        (
            "FREQ=MONTHLY;INTERVAL=6;UNTIL=20271231",
            "20260601",
            [date(2026, 12, 1), date(2027, 6, 1), date(2027, 12, 1)],
        ),
        ("FREQ=WEEKLY;BYDAY=TU;COUNT=3", "20261124", [date(2026, 12, 1), date(2026, 12, 8)]),
    ],
)
@pytest.mark.usefixtures("at_the_end_of_2026")
def test_an_entry_returns_by_its_rule(rule, start, days):
    assert days_of(rule, f"DTSTART;VALUE=DATE:{start}") == (days, [])


@pytest.mark.usefixtures("at_the_end_of_2026")
def test_dates_of_a_series_may_be_left_out_added_and_moved():
    more = "EXDATE;VALUE=DATE:20261208\nRDATE;VALUE=DATE:20261210"
    dates = "RECURRENCE-ID;VALUE=DATE:20261215\nDTSTART;VALUE=DATE:20261216"
    moved = f"BEGIN:VEVENT\nUID:1\n{dates}\nSUMMARY:Free\nEND:VEVENT\n"
    found, left = days_of("FREQ=WEEKLY;COUNT=3", f"DTSTART;VALUE=DATE:20261201\n{more}", moved)
    assert ([day.day for day in found], left) == ([1, 10, 16], [])


@pytest.mark.parametrize(
    "rule", ["FREQ=HOURLY", "FREQ=DAILY;INTERVAL=0", "FREQ=YEARLY;RSCALE=HEBREW", "FREQ=YEARLY;BYDAY=XX"]
)
def test_an_entry_that_cannot_be_taken_is_named_first(rule, signed_in, staff):
    event = f"BEGIN:VEVENT\nUID:9\nDTSTART;VALUE=DATE:20200101\nRRULE:{rule}\nSUMMARY:Odd day\nEND:VEVENT\n"
    data = file().replace(b"END:VCALENDAR", event.encode() + b"END:VCALENDAR")
    sent = {"action": "read", "file": SimpleUploadedFile("school.ics", data)}
    shown = signed_in(staff).post(reverse("holidays"), sent).content.decode()
    assert "<li>Odd day</li>" in shown
    assert f"until 31 Dec {last_read().year}" in shown
    assert "Winter break" in shown
    assert not Holiday.objects.exists()


def test_days_of_a_file_are_those_of_the_lab(settings):
    settings.TIME_ZONE = "Europe/Madrid"
    found = {one.name: one for one in read_file(file(date(FIRST.year + 1, 7, 6)))[0]}
    assert found["Late in UTC"].first_day == date(FIRST.year + 1, 7, 7)
    assert found["Winter break"].last_day - found["Winter break"].first_day == timedelta(days=2)
    assert set(found) == {"Late in UTC", "Winter break", "May Day"}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x00\xff", "no calendar file"),
        (b"BEGIN:VCALENDAR\nBEGIN:VEVENT\nSUMMARY:x\nEND:VEVENT\nEND:VCALENDAR", "no calendar file"),
        (
            b"BEGIN:VCALENDAR\nBEGIN:VEVENT\nDTSTART:99999\nSUMMARY:x\nEND:VEVENT\nEND:VCALENDAR",
            "no calendar",
        ),
        (b"x" * 1_000_001, "larger than 1 MB"),
    ],
)
def test_other_files_are_refused_in_words(data, words):
    with pytest.raises(ValidationError) as caught:
        read_file(data)
    assert words in caught.value.messages[0]


def test_a_holiday_over_bookings_asks_first_and_can_be_undone(signed_in, robot, operator, staff):
    now = timezone.now()
    booking = booking_make(robot=robot, person=operator, slot=on(FIRST), now=now)
    other = booking_make(robot=robot, person=operator, slot=on(FIRST + timedelta(days=1)), now=now)
    browser, holiday = signed_in(staff), {"name": "Break", "first_day": str(FIRST)}
    asked = browser.post(reverse("holidays"), holiday)
    page = asked.content.decode()
    assert (asked.status_code, "Olga Operator" in page, "The lab is closed: Break" in page) == (
        409,
        True,
        True,
    )
    assert not Holiday.objects.exists()
    digest = re.search(r'name="losses_seen" value="(\w+)"', page)[1]
    browser.post(reverse("holidays"), {**holiday, "losses_seen": digest})
    assert Holiday.objects.get().name == "Break"
    booking.refresh_from_db()
    other.refresh_from_db()
    assert (booking.state, other.state) == ("cancelled", "booked")
    change = Change.objects.get()
    assert change.about.startswith("Break")
    browser.post(reverse("change-undo", args=[change.pk]))
    booking.refresh_from_db()
    assert (booking.state, Holiday.objects.exists()) == ("booked", False)


def test_bookings_of_other_days_stay_possible(robot, operator, holiday):
    booking_make(
        robot=robot, person=operator, slot=on(holiday.last_day + timedelta(days=1)), now=timezone.now()
    )
    assert Booking.objects.count() == 1
