"""Recordings by hand end with the time and the right for which they were begun."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.models import Booking
from robots.registry.models import Robot, RobotRole
from robots.shared.wire import LinkRecord, LinkRecordEnd
from teleop.recordings.orders.by_hand import LOOK_S, HandRecordings
from tests.teleop.recordings.test_of_bookings import FakeBridge, clock, recorder

pytestmark = pytest.mark.django_db
__all__ = ["clock", "recorder"]
NOW = timezone.now()


@pytest.fixture
def booked(robot: Robot) -> Callable[..., Booking]:
    def make(person: User, begins_min: float = -5) -> Booking:
        begins_at, ends_at = NOW + timedelta(minutes=begins_min), NOW + timedelta(hours=1)
        return Booking.objects.create(
            robot=robot,
            person=person,
            starts_at=begins_at,
            ends_at=ends_at,
            held_until=ends_at,
            made_at=begins_at,
            used_at=begins_at,
        )

    return make


@pytest.fixture
def record_and_look(
    recorder: FakeBridge, clock: list[float], supervisor: User, signed_in: Any
) -> Callable[..., list[Any]]:
    """`record_and_look(change)`: they record, this happens, housekeeping looks; the further orders."""
    housekeeping = HandRecordings()

    def look(change: Callable[[], object]) -> list[Any]:
        before = len(recorder.orders)
        begun = signed_in(supervisor).post("/api/v1/robots/tiago-1/recordings", {}, "application/json")
        assert begun.status_code == 201
        change()
        for _ in range(2):
            clock[0] += LOOK_S
            housekeeping.step(timezone.now())
        return recorder.orders[before + 1 :]

    return look


def test_its_slot_ends_early(
    booked: Any, record_and_look: Any, recorder: FakeBridge, operator: User, second_operator: User
) -> None:
    booking = booked(operator)
    assert record_and_look(lambda: None) == []
    recorder.recording = None

    def given_up() -> None:
        Booking.objects.filter(pk=booking.pk).update(state="finished", held_until=NOW)
        booked(second_operator, 0.0)  # somebody else takes the rest

    [end] = record_and_look(given_up)
    assert isinstance(recorder.orders[-2], LinkRecord) and end == LinkRecordEnd(recorder.orders[-2].recording)
    ended = Record.objects.get(kind="recording.end", of=None)
    assert ended.actor is None and ended.parameters["because"] == "slot"


def test_somebody_books_the_free_time(
    booked: Any, record_and_look: Any, recorder: FakeBridge, supervisor: User, operator: User
) -> None:
    mine: list[Booking] = []
    assert record_and_look(lambda: mine.append(booked(supervisor))) == []  # their own booking changes nothing
    mine[0].delete()
    recorder.recording = None
    assert len(record_and_look(lambda: booked(operator))) == 1


def test_who_began_it_may_not_drive_any_more(record_and_look: Any, supervisor: User) -> None:
    [end] = record_and_look(lambda: RobotRole.objects.filter(user=supervisor).update(role="observer"))
    assert isinstance(end, LinkRecordEnd)
