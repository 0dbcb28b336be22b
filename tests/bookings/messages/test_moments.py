"""A slot begins, a slot has ended, somebody's turn has come."""

from datetime import UTC, datetime, timedelta

import pytest
from django.db.models import QuerySet

from fleet.bookings.messages import moments, notifications
from fleet.bookings.messages.moments import write_moments
from fleet.bookings.models import Booking, Notification
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make

pytestmark = pytest.mark.django_db

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


def at(minutes):
    return NOW + timedelta(minutes=minutes)


def book(robot, person, begins, ends, **more):
    return booking_make(robot=robot, person=person, slot=Slot(at(begins), at(ends)), now=at(-60), **more)


def written():
    rows = Notification.objects.order_by("pk").values_list("person__username", "subject", "text")
    found = [(who, subject, text) for who, subject, text in rows]
    Notification.objects.all().delete()
    return found


def test_a_slot_that_begins_is_told_once_five_minutes_before(robot, operator, mailoutbox):
    operator.email, operator.language = "o@example.org", "es"
    operator.save()
    booking = book(robot, operator, 0, 60, purpose="SLAM")
    write_moments(at(-5.1))
    assert not Notification.objects.exists()
    for minute in (-4.9, -4.8):
        write_moments(at(minute))
    [told] = Notification.objects.all()
    assert told.subject == "TIAGo 1: su franja comienza en 5 minutos"
    assert (told.path, told.until) == ("/robots/tiago-1/", at(10))
    assert "SLAM" in told.text
    notifications.send_notifications(at(-4))
    assert not mailoutbox  # it would come too late
    assert notifications.notifications_unseen([operator.pk], at(11)) == {operator.pk: []}
    Booking.objects.filter(pk=booking.pk).update(starts_at=at(30))
    write_moments(at(26))
    assert Notification.objects.count() == 2  # a slot that was moved begins again


def test_a_slot_booked_a_moment_before_begins_without_words(robot, operator):
    slot = Slot(at(3), at(60))
    booking_make(robot=robot, person=operator, slot=slot, now=at(0))
    write_moments(at(1))
    assert not Notification.objects.exists()


def test_a_slot_that_ended_says_what_is_next(robot, operator, second_operator):
    booking = book(robot, operator, 0, 60)
    write_moments(at(60.1))
    assert not Notification.objects.exists()  # nobody used it
    Booking.objects.filter(pk=booking.pk).update(used_at=at(1))
    for _ in range(2):
        write_moments(at(60.1))
    [(_who, subject, text)] = written()
    assert (subject, text) == (
        "TIAGo 1: your slot ended",
        "Nobody has booked the robot for the next hours.",
    )
    book(robot, second_operator, 120, 180)
    write_moments(at(60.2))
    assert written()[0][2] == "The robot is free until Mon 02 Mar, 11:00."
    Booking.objects.filter(person=second_operator).update(starts_at=at(60))
    write_moments(at(60.3))
    assert written()[0][2] == f"Next, at 10:00: {second_operator.display_name}."
    write_moments(at(70))
    assert not Notification.objects.exists()  # too late to be news


def test_two_processes_write_a_moment_once(robot, operator, monkeypatch):
    book(robot, operator, 0, 60)
    write_moments(at(-4))
    monkeypatch.setattr(QuerySet, "exists", lambda _self: False)  # both looked before either wrote
    monkeypatch.setattr(moments, "_untold", lambda booking, key: [(operator, f"{key} {operator.pk}")])
    write_moments(at(-4))
    assert Notification.objects.count() == 1
