"""Bookings as events of calendar programs: attached to letters, and in feeds."""

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone
from icalendar import Calendar

from fleet.bookings.changes.handing import hand_answer, hand_ask
from fleet.bookings.messages import notifications
from fleet.bookings.models import Booking
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make

pytestmark = pytest.mark.django_db

NOW = timezone.now().replace(microsecond=0)


@pytest.fixture
def olga(operator, robot, settings):
    settings.DEFAULT_FROM_EMAIL = '"Robots, Lab" <robots@lab.example>'
    robot.room = "Lab 2.13"
    robot.save()
    operator.email = "olga@example.org"
    operator.save()
    return operator


@pytest.fixture
def booking(robot, olga):
    slot = Slot(NOW + timedelta(hours=30), NOW + timedelta(hours=31))
    return booking_make(robot=robot, person=olga, slot=slot, purpose="Exercise 7", now=NOW)


def sent(mailoutbox):
    """Send the letters that wait. Return the newest one, and its event with the method of its calendar."""
    notifications.send_notifications(NOW)
    [part] = mailoutbox[-1].attachments
    found = Calendar.from_ical(part.get_payload(decode=True))
    [event] = found.walk("VEVENT")
    assert part.get_param("method") == found["method"]
    return mailoutbox[-1], str(found["method"]), event


def change(browser, booking, **fields):
    booking.refresh_from_db()
    answer = browser.post(reverse("booking", args=[booking.pk]), {"version": booking.version, **fields})
    assert answer.status_code == 200
    booking.refresh_from_db()


def moved(booking, hours):
    times = {"starts_at": booking.starts_at, "ends_at": booking.ends_at}
    return {name: f"{at + timedelta(hours=hours):%Y-%m-%dT%H:%M}" for name, at in times.items()}


def test_a_program_moves_and_removes_the_event_that_it_has(signed_in, olga, supervisor, booking, mailoutbox):
    browser = signed_in(supervisor)
    change(browser, booking, action="move", **moved(booking, 2))
    letter, method, event = sent(mailoutbox)
    assert (method, event["uid"], event["sequence"]) == ("REQUEST", f"{booking.pk}@fleet-console", 2)
    assert event.start == booking.starts_at
    assert (event["location"], event["status"]) == ("Lab 2.13", "CONFIRMED")
    assert (event["organizer"], event["organizer"].params["CN"]) == (
        "mailto:robots@lab.example",
        "Robots, Lab",
    )
    assert event["attendee"] == "mailto:olga@example.org"
    link = f"http://testserver{reverse('booking', args=[booking.pk])}"
    assert letter.from_email == '"Robots, Lab" <robots@lab.example>'
    assert f"Room: Lab 2.13\nPurpose: Exercise 7\n{link}" in letter.body
    assert (event["url"], event["description"]) == (link, f"Exercise 7\n{link}")
    change(browser, booking, action="cancel")
    _letter, method, event = sent(mailoutbox)
    assert (method, event["uid"], event["sequence"], event["status"]) == (
        "CANCEL",
        f"{booking.pk}@fleet-console",
        4,
        "CANCELLED",
    )
    assert event.end > event.start


def test_a_booking_that_is_handed_on_leaves_its_giver(olga, second_operator, booking, mailoutbox):
    second_operator.email = "olaf@example.org"
    second_operator.save()
    offer, _code = hand_ask(booking_id=booking.pk, version=1, to=second_operator, actor=olga, now=NOW)
    hand_answer(offer_id=offer.pk, actor=second_operator, accept=True, now=NOW)
    notifications.send_notifications(NOW)
    methods = [(one.to[0], part.get_param("method")) for one in mailoutbox for part in one.attachments]
    assert sorted(methods) == [("olaf@example.org", "REQUEST"), ("olga@example.org", "CANCEL")]


def test_a_reminder_has_the_event_but_no_link_without_an_address(olga, booking, mailoutbox, settings):
    settings.FLEET_ORIGINS = []
    settings.FLEET_TLS = False
    notifications.write_reminders(NOW + timedelta(hours=29.5))
    letter, method, event = sent(mailoutbox)
    assert (method, "url" in event, "http" in letter.body) == ("REQUEST", False, False)
    settings.FLEET_ORIGINS = ["https://fleet.example:8443"]
    Booking.objects.update(reminded_at=None)
    notifications.write_reminders(NOW + timedelta(hours=29.5))
    letter, _method, event = sent(mailoutbox)
    assert event["url"].startswith("https://fleet.example:8443/bookings/")


def test_a_feed_has_room_purpose_link_and_the_last_change(signed_in, client, olga, robot, booking):
    browser = signed_in(olga)
    page = browser.post(reverse("bookings-address"), {}).content.decode()
    address = page.split('readonly value="')[1].split('"')[0]
    [event] = Calendar.from_ical(client.get(address).content).walk("VEVENT")
    assert (event["location"], event["description"].split("\n")[0]) == ("Lab 2.13", "Exercise 7")
    assert event["url"].endswith(reverse("booking", args=[booking.pk]))
    assert event["last-modified"].dt >= NOW


def test_a_feed_of_a_robot_tells_others_nothing_of_what_is_over(
    signed_in, olga, second_operator, robot, booking, client
):
    begun, over = NOW - timedelta(hours=3), NOW - timedelta(hours=2)
    Booking.objects.update(starts_at=begun, ends_at=over, held_until=over, used_at=begun)
    page = (
        signed_in(second_operator).post(reverse("bookings-address"), {"robot": robot.slug}).content.decode()
    )
    [event] = Calendar.from_ical(client.get(page.split('readonly value="')[1].split('"')[0]).content).walk(
        "VEVENT"
    )
    assert "Exercise" not in event.to_ical().decode()
    assert "last-modified" not in event
