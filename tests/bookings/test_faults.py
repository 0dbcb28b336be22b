"""Faults of bookings: the robot, the person's right, the database or the clock fails; no booking is lost."""

import sqlite3
from datetime import timedelta

import pytest
from django.core.management import call_command
from django.db import OperationalError, connection
from django.db.models import F, ProtectedError
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings import services
from fleet.bookings.changes import waiting_list as waiting
from fleet.bookings.changes.waiting_list import keep_waiting_lists, waiting_join
from fleet.bookings.losses.lost_rights import bookings_free_lost
from fleet.bookings.models import Booking, Notification, State, Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.schedule import schedule_of
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment, RobotGroup
from robots.access.selectors import lab_date
from robots.registry.models import Robot
from tests.bookings.losses.support import confirm

pytestmark = pytest.mark.django_db(transaction=True)

JSON = {"HTTP_ACCEPT": "application/json"}
HTML = {"HTTP_ACCEPT": "text/html"}


@pytest.fixture
def olga(operator):
    operator.email = "olga@lab.example"
    operator.save()
    return operator


def slot(hours=24.0, length=1.0):
    starts = timezone.now().replace(second=0, microsecond=0) + timedelta(hours=hours)
    return Slot(starts, starts + timedelta(hours=length))


def fields(robot, when):
    times = {"starts_at": when.starts_at, "ends_at": when.ends_at}
    return {"robot": robot.slug, **{name: f"{time:%Y-%m-%dT%H:%M}" for name, time in times.items()}}


def book(robot, person, when=None):
    return booking_make(robot=robot, person=person, slot=when or slot(), now=timezone.now())


def running(robot, person, course=None):
    """A slot that began ten minutes ago, in which its person drives."""
    when = slot(-1 / 6)
    times = {"starts_at": when.starts_at, "ends_at": when.ends_at, "held_until": when.ends_at}
    return Booking.objects.create(
        robot=robot, person=person, course=course, used_at=when.starts_at, made_at=when.starts_at, **times
    )


def codes(answer):
    return [refusal["code"] for refusal in answer.json()["refusals"]]


# --- the robot ------------------------------------------------------------------------------------


def edit(admin, robot, **changes):
    """Send the admin's form of a robot as a browser does, with these changes; None unticks a box."""
    address = f"/admin/robots/robot/{robot.pk}/change/"
    page = admin.get(address)
    form = page.context["adminform"].form
    sent = {name: form[name].value() for name in form.fields}
    for inline in page.context["inline_admin_formsets"]:
        management = inline.formset.management_form
        sent |= {management.add_prefix(name): management[name].value() for name in management.fields}
        for row in inline.formset.initial_forms:
            sent |= {row.add_prefix(name): row[name].value() for name in row.fields}
    sent = {
        name: value for name, value in (sent | changes).items() if value is not None and value is not False
    }
    answer = admin.post(address, sent)
    if answer.status_code == 409:
        answer = confirm(admin, answer)
    assert answer.status_code == 302, answer.context["errors"]


def test_a_robot_that_is_switched_off_tells_those_who_booked_it(signed_in, robot, olga, staff):
    booking, admin = book(robot, olga), signed_in(staff)
    edit(admin, robot, enabled=None)
    notification = Notification.objects.get()
    assert (notification.person, "out of service" in notification.subject) == (olga, True)
    assert "switched it off" in notification.text
    edit(admin, robot, name="Other")  # no second notification
    assert Notification.objects.count() == 1
    booking.refresh_from_db()
    assert booking.state == State.BOOKED  # the robot may come back
    page = signed_in(olga)
    assert codes(page.post(reverse("booking-new"), fields(robot, slot(48)), **JSON)) == ["out_of_service"]
    days = {"start": str(lab_date()), "end": str(lab_date() + timedelta(days=2))}
    events = page.get(reverse("bookings-feed"), days).json()["events"]
    assert "staff switched it off" in [event["title"] for event in events]
    assert page.get(reverse("bookings-next-free"), follow=True).status_code == 200
    page.post(reverse("booking", args=[booking.pk]), {"action": "cancel", "version": 1})
    assert Booking.objects.get().state == State.CANCELLED


def test_a_robot_with_bookings_cannot_be_deleted(signed_in, robot, operator, staff):
    book(robot, operator)
    with pytest.raises(ProtectedError):
        robot.delete()
    staff.is_superuser = True
    staff.save()
    admin = signed_in(staff)
    assert admin.post(f"/admin/robots/robot/{robot.pk}/delete/", {"post": "yes"}).status_code == 403
    assert Booking.objects.filter(robot=Robot.objects.get()).count() == 1
    assert not Record.objects.filter(kind="robot.delete").exists()


def test_a_robot_deleted_under_an_open_form_is_refused_in_words(signed_in, robot, other_robot, staff):
    desk = signed_in(staff)
    form = fields(other_robot, slot())
    other_robot.delete()
    answer = desk.post(reverse("booking-new"), form, **JSON)
    assert (answer.status_code, codes(answer)) == (409, ["invalid_choice"])


@pytest.fixture
def course(robot, stranger):
    """A course in which the stranger may drive the robot by its group."""
    today = lab_date()
    course = Course.objects.create(
        name="HRI", slug="hri", starts_on=today - timedelta(days=9), ends_on=today + timedelta(days=9)
    )
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.add(robot)
    course.groups.add(group)
    Enrolment.objects.create(course=course, person=stranger)
    User.objects.filter(pk=stranger.pk).update(email="stig@lab.example")
    stranger.refresh_from_db()
    return course


def test_a_robot_that_moves_to_another_group_frees_its_bookings(
    signed_in, robot, other_robot, stranger, staff, course
):
    booking = book(robot, stranger)
    entry = {"entry": "the-tiagos", "the-tiagos-name": "The TIAGos", "the-tiagos-robots": [other_robot.pk]}
    desk = signed_in(staff)
    confirm(desk, desk.post("/robot-groups/", entry))
    booking.refresh_from_db()
    assert booking.state == State.CANCELLED
    assert "may not drive" in Notification.objects.get().text
    book(robot, staff)  # the slot is free


# --- the right of its person ----------------------------------------------------------------------


def test_a_slot_that_outlasts_the_course_is_refused(signed_in, robot, stranger, course):
    midnight = timezone.now().replace(hour=23, minute=30) + timedelta(days=9)
    desk = signed_in(stranger)
    over_midnight = Slot(midnight, midnight + timedelta(hours=1))
    assert codes(desk.post(reverse("booking-new"), fields(robot, over_midnight), **JSON)) == ["role_too_low"]
    before = Slot(midnight - timedelta(hours=1), midnight)
    assert desk.post(reverse("booking-new"), fields(robot, before), **JSON).status_code == 200


def test_a_course_that_ends_mid_slot_frees_the_rest(signed_in, robot, stranger, staff, course):
    booking = running(robot, stranger, course)
    address = reverse("course-archive", args=[course.slug])
    desk = signed_in(staff)
    confirm(desk, desk.post(address, {"archived": "1"}))
    booking.refresh_from_db()
    assert booking.state == State.FINISHED
    assert booking.held_until < booking.ends_at
    assert schedule_of(robot, timezone.now()).current is None
    assert "ended" in Notification.objects.get().subject
    assert Record.objects.get(kind="booking.cancel").parameters["why"] == "role_too_low"


def test_a_running_slot_stays_while_its_person_may_drive(robot, operator):
    booking = running(robot, operator)
    assert bookings_free_lost([operator.pk], timezone.now()) == 0
    booking.refresh_from_db()
    assert (booking.state, booking.held_until) == (State.BOOKED, booking.ends_at)


# --- the database ---------------------------------------------------------------------------------


@pytest.fixture
def lock():
    """`lock()`: another process locks the database; `lock.free()` ends it."""
    if connection.vendor != "sqlite":
        pytest.skip("locks the database file")
    other = sqlite3.connect(connection.settings_dict["NAME"])

    def begin():
        with connection.cursor() as cursor:
            cursor.execute("PRAGMA busy_timeout = 50")
        other.execute("BEGIN IMMEDIATE")

    begin.free = other.rollback
    yield begin
    other.close()
    connection.close()


def changes_of(robot, booking, when):
    """Return each change that a person can make on the pages of bookings: address and form."""
    one = reverse("booking", args=[booking.pk])
    return [
        (reverse("booking-new"), fields(robot, slot(30))),
        (one, {**fields(robot, slot(40)), "action": "move", "version": 1}),
        (one, {"action": "hand", "version": 1, "to": "second"}),
        (one, {"action": "cancel", "version": 1}),
        (reverse("bookings-address"), {}),
        (reverse("bookings-waiting"), fields(robot, when)),
    ]


def unchanged(booking, before):
    booking.refresh_from_db()
    stored = (booking.person_id, booking.starts_at, booking.state, booking.version)
    return stored == before and Booking.objects.count() == 2 and not Waiting.objects.exists()


def all_refused(desk, robot, mine, others, code, words, most=None):
    before = (mine.person_id, mine.starts_at, mine.state, mine.version)
    when = Slot(others.starts_at, others.ends_at)
    for address, form in changes_of(robot, mine, when)[:most]:
        answer = desk.post(address, form, **JSON)
        assert answer.status_code == 503, (address, form)
        assert answer.json()["code"] == code
        page = desk.post(address, form, **HTML)
        assert (page.status_code, words in page.content.decode()) == (503, True), (address, form)
        assert page.headers["Retry-After"]
    assert unchanged(mine, before)


@pytest.fixture
def two(robot, operator, second_operator):
    """A booking of the operator, and one of the second operator."""
    return book(robot, operator), book(robot, second_operator, slot(26))


def test_a_locked_database_is_said_and_changes_nothing(lock, signed_in, robot, operator, two):
    desk = signed_in(operator)
    lock()
    all_refused(desk, robot, *two, "database_locked", "another process keeps the database locked")
    assert desk.get(reverse("bookings-mine")).status_code == 200  # reading works
    lock.free()
    assert desk.post(reverse("booking-new"), fields(robot, slot(30)), **JSON).status_code == 200


def test_a_full_disk_is_said_and_changes_nothing(disk, signed_in, robot, operator, two):
    desk = signed_in(operator)
    disk.fill()
    all_refused(desk, robot, *two, "audit_disk_full", "the disk of the database is full")
    assert desk.get(reverse("bookings-mine")).status_code == 200
    disk.free()
    assert desk.post(reverse("booking-new"), fields(robot, slot(30)), **JSON).status_code == 200


def test_a_database_that_is_away_is_said(signed_in, robot, operator, two, monkeypatch):
    def away(*_args, **_options):
        raise OperationalError("connection refused")

    desk = signed_in(operator)
    monkeypatch.setattr(services, "record", away)  # in the middle of each change
    monkeypatch.setattr(waiting.Waiting.objects, "update_or_create", away)
    monkeypatch.setattr("fleet.bookings.messages.ical.record", away)
    all_refused(desk, robot, *two, "database_unreachable", "the database does not answer")


def test_an_offer_that_cannot_be_stored_is_made_later(disk, robot, operator, second_operator):
    book(robot, operator)
    waiting_join(robot=robot, person=second_operator, slot=slot(), now=timezone.now())
    Booking.objects.update(held_until=F("starts_at"), state=State.CANCELLED)
    disk.fill()
    with pytest.raises(Exception, match="disk"):
        keep_waiting_lists(timezone.now())
    assert Waiting.objects.count() == 1
    disk.free()
    keep_waiting_lists(timezone.now())
    assert Booking.objects.get(state=State.OFFERED).person == second_operator


def test_housekeeping_survives_a_locked_database(lock, robot, operator, two):
    lock()
    with pytest.raises(OperationalError, match="locked"):
        call_command("run_housekeeping", "--once")
    lock.free()
    call_command("run_housekeeping", "--once")
