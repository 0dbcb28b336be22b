"""A weekly series as one: seen, moved and cancelled through its page."""

from datetime import UTC, date, datetime, timedelta

import pytest
from django.contrib.messages import get_messages
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.changes.series import series_make, weekly
from fleet.bookings.changes.whole_series import Change, moved
from fleet.bookings.models import Booking, OutOfService, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.registry.models import RobotRole, Role

pytestmark = pytest.mark.django_db


@pytest.fixture
def first():
    """10:00 in two days."""
    return (timezone.now() + timedelta(days=2)).replace(hour=10, minute=0, second=0, microsecond=0)


@pytest.fixture
def series(robot, supervisor, first):
    """Three weeks of the supervisor."""
    slots = weekly(Slot(first, first + timedelta(hours=1)), 3, [])
    common = {"robot": robot, "person": supervisor, "actor": supervisor, "slots": slots}
    made, _left = series_make(**common, purpose="HRI", override="", now=timezone.now())
    return made


def page(series):
    return reverse("booking-whole-series", args=[series[0].series])


def times(series):
    rows = Booking.objects.filter(series=series[0].series).order_by("starts_at")
    return [(one.starts_at, one.ends_at) for one in rows]


def test_its_page_has_all_dates_with_what_is_against_them(
    signed_in, robot, supervisor, operator, series, first
):
    OutOfService.objects.create(
        robot=robot, starts_at=series[1].starts_at, ends_at=series[1].ends_at, why="repair"
    )
    Booking.objects.filter(pk=series[2].pk).update(state=State.CANCELLED, held_until=series[2].starts_at)
    browser = signed_in(supervisor)
    shown = browser.get(page(series)).content.decode()
    assert (shown.count("is out of service"), shown.count("cancelled<")) == (1, 1)
    assert f"{first:%A} 10:00 - 11:00" in shown
    assert page(series) in browser.get(reverse("booking", args=[series[0].pk])).content.decode()
    assert page(series) in browser.get(reverse("booking-series")).content.decode()
    assert signed_in(operator).get(page(series)).status_code == 404


def test_it_moves_in_one_step_except_where_a_rule_refuses(
    signed_in, robot, supervisor, operator, series, first
):
    hour, week = timedelta(hours=1), timedelta(days=7)
    taken = Slot(first + week + 4 * hour, first + week + 5 * hour)
    booking_make(robot=robot, person=operator, slot=taken, now=timezone.now())
    browser, before = signed_in(supervisor), times(series)
    change = {"since": f"{first:%Y-%m-%d}", "begins": "14:00", "minutes": "90"}
    seen = browser.post(page(series), {**change, "action": "preview"}).content.decode()
    assert (seen.count("14:00 to 15:30"), "has booked TIAGo 1 from" in seen) == (3, True)
    assert times(series) == before
    done = browser.post(page(series), {**change, "action": "move"})
    [told] = map(str, get_messages(done.wsgi_request))
    assert told.startswith("Moved: 2 dates. These stay as they are:")
    new = (first + 4 * hour, first + 5.5 * hour)
    assert times(series) == [new, before[1], tuple(at + 2 * week for at in new)]
    assert Record.objects.filter(kind="booking.move").count() == 2


def test_it_moves_to_another_robot_and_weekday(signed_in, robot, other_robot, supervisor, series, first):
    RobotRole.objects.create(user=supervisor, robot=other_robot, role=Role.SUPERVISOR)
    since = series[1].starts_at
    other_day = (first.weekday() + (1 if first.weekday() < 6 else -1)) % 7
    change = {"since": f"{since:%Y-%m-%d}", "weekday": str(other_day), "robot": other_robot.slug}
    signed_in(supervisor).post(page(series), {**change, "action": "move"})
    stored = list(Booking.objects.order_by("starts_at"))
    assert [one.robot for one in stored] == [robot, other_robot, other_robot]
    assert [one.starts_at.weekday() for one in stored] == [first.weekday(), other_day, other_day]
    parameters = Record.objects.filter(kind="booking.move").first().parameters
    assert parameters["before"]["robot"] == robot.slug


def test_a_robot_that_one_may_not_book_for_others_is_no_choice(
    signed_in, other_robot, supervisor, series, first
):
    change = {"since": f"{first:%Y-%m-%d}", "robot": other_robot.slug, "action": "move"}
    assert signed_in(supervisor).post(page(series), change).status_code == 400
    assert not Booking.objects.filter(robot=other_robot).exists()


def test_it_is_cancelled_from_a_day_on(signed_in, robot, supervisor, series):
    Policy.objects.create(robot=robot, cancel_notice_min=24 * 60 * 30)  # a supervisor needs no notice
    since = f"{series[1].starts_at:%Y-%m-%d}"
    done = signed_in(supervisor).post(
        page(series), {"action": "cancel", "since": since, "reason": "Term ends"}
    )
    assert [str(one) for one in get_messages(done.wsgi_request)] == ["Cancelled: 2 dates."]
    states = Booking.objects.order_by("starts_at").values_list("state", flat=True)
    assert list(states) == ["booked", "cancelled", "cancelled"]
    assert [one.content.text for one in Record.objects.filter(kind="booking.cancel")] == ["Term ends"] * 2


def test_a_date_keeps_its_week_and_the_clock_on_the_wall(robot, supervisor, settings):
    settings.TIME_ZONE = "Europe/Madrid"
    starts = datetime(2027, 3, 27, 23, 30, tzinfo=UTC)  # Sunday, 00:30 in Madrid; the clock skips 02:00
    booking = Booking(robot=robot, person=supervisor, starts_at=starts, ends_at=starts + timedelta(hours=1))
    slot = moved(booking, Change(minutes=150))
    assert slot.ends_at - slot.starts_at == timedelta(minutes=90)  # until 03:00 on the wall
    monday = moved(booking, Change(weekday=0))
    assert monday.starts_at.date() == date(2027, 3, 21)
    skipped = moved(booking, Change(minutes=105))  # until 02:15
    assert skipped.code == "time_gap"
