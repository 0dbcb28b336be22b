"""Recordings of bookings, begun and ended by housekeeping."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any
from uuid import uuid4

import pytest
from django.urls import reverse
from django.utils import timezone
from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.models import Booking
from robots.access.models import Course
from robots.link.connections import LinkRefused
from robots.registry.models import Robot
from robots.shared.wire import LinkRecord, LinkRecordEnd, RecordingState, Refusal
from teleop.api.v1.robot import recording as requests_of_programs
from teleop.recordings.orders import by_hand, of_bookings
from teleop.recordings.orders import housekeeping as housekeeping_orders
from teleop.recordings.orders.of_bookings import AGAIN_S, LOOK_S, BookingRecorder
from tests.teleop.recordings.test_sight import at

pytestmark = pytest.mark.django_db


class FakeBridge:
    """A robot's recorder behind its link."""

    def __init__(self) -> None:
        self.orders: list[LinkRecord | LinkRecordEnd] = []
        self.recording: RecordingState | None = None
        self.refusal: Refusal | None = None

    def state_once(self, *_robot: object) -> Any:
        return _State(self.recording)

    def order_once(self, _robot: object, _address: object, order: Any, _within_s: float) -> None:
        if self.refusal is not None:
            raise LinkRefused(self.refusal)
        self.orders.append(order)
        self.recording = (
            RecordingState(order.recording, order.kind, order.by, "all", 0.0, order.seconds)
            if isinstance(order, LinkRecord)
            else None
        )


class _State(Struct):
    recording: RecordingState | None


@pytest.fixture
def recorder(monkeypatch: pytest.MonkeyPatch) -> FakeBridge:
    fake = FakeBridge()
    monkeypatch.setattr(housekeeping_orders, "state_once", fake.state_once)
    monkeypatch.setattr(housekeeping_orders, "order_once", fake.order_once)
    monkeypatch.setattr(requests_of_programs, "order_once", fake.order_once)
    return fake


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The monotonic clock of housekeeping."""
    clock = [1000.0]
    for module in (of_bookings, by_hand):
        monkeypatch.setattr(module.time, "monotonic", lambda: clock[0])
    return clock


@pytest.fixture
def booked(robot: Robot, operator: User) -> Callable[..., Booking]:
    def make(begins: float = 0, ends: float = 60, **given: Any) -> Booking:
        times = {"starts_at": at(begins), "ends_at": at(ends), "held_until": at(ends), "made_at": at(-99)}
        return Booking.objects.create(
            robot=robot, person=operator, **(times | {"used_at": at(begins)} | given)
        )

    return make


def test_a_slot_is_recorded_from_its_first_control_until_its_end(booked: Any, recorder: FakeBridge) -> None:
    booking, housekeeping = booked(record=True, used_at=None), BookingRecorder()
    housekeeping.step(at(1))
    assert recorder.orders == []  # nobody has control yet
    Booking.objects.update(used_at=at(10))
    for _ in range(2):
        housekeeping.step(at(10))
    [order] = recorder.orders
    assert isinstance(order, LinkRecord) and order.seconds == 50 * 60 and order.kind == "booking"
    assert (order.booking, order.person, order.topics) == (str(booking.pk), str(booking.person_id), "all")
    outcomes = Record.objects.filter(kind="recording.begin").order_by("pk").values_list("outcome", flat=True)
    assert list(outcomes) == ["", "accepted"]


def test_a_changed_slot_changes_its_recording(booked: Any, recorder: FakeBridge) -> None:
    booking, housekeeping = booked(record=True), BookingRecorder()
    housekeeping.step(at(1))
    Booking.objects.update(ends_at=at(90), held_until=at(90))
    housekeeping.step(at(30))
    assert len(recorder.orders) == 1
    recorder.recording = None  # the bridge's clock ended it
    housekeeping.step(at(60))
    assert isinstance(recorder.orders[1], LinkRecord) and recorder.orders[1].seconds == 30 * 60
    Booking.objects.filter(pk=booking.pk).update(state="finished", held_until=at(70), ends_at=at(70))
    housekeeping.step(at(70))
    assert recorder.orders[2] == LinkRecordEnd(recorder.orders[1].recording)
    housekeeping.step(at(71))
    assert len(recorder.orders) == 3


def test_lessons_of_a_course_and_the_rule_of_the_lab(
    booked: Any, recorder: FakeBridge, settings: Any
) -> None:
    course = Course.objects.create(
        name="HRI", slug="hri", starts_on=at(0), ends_on=at(0), record_lessons=True
    )
    booked(0, 10, course=course)  # counts for it, is no lesson
    booked(10, 20, course=course, shared="course")
    for minute in (5, 15):
        BookingRecorder().step(at(minute))
    assert [order.course for order in recorder.orders if isinstance(order, LinkRecord)] == ["hri"]
    settings.FLEET_RECORD_EVERY_BOOKING, recorder.recording = True, None
    booked(20, 30)
    BookingRecorder().step(at(25))
    assert len(recorder.orders) == 2


def test_what_is_refused_is_on_record_and_tried_again(
    booked: Any, recorder: FakeBridge, settings: Any, clock: list[float]
) -> None:
    booked(record=True)
    housekeeping, theirs = BookingRecorder(), RecordingState(uuid4(), "booking", "Ben", "all", 0.0, 60.0)

    def attempt(minute: float) -> int:
        clock[0] += AGAIN_S + 1
        housekeeping.step(at(minute))
        housekeeping.step(at(minute))
        return len(recorder.orders)

    recorder.recording = theirs
    assert attempt(1) == 0 and not Record.objects.filter(kind="recording.begin").exists()
    recorder.recording = structs.replace(theirs, left_s=0.0, refusal=Refusal("disk_full", "Full.", "limits"))
    recorder.refusal = Refusal("disk_full", "Full.", "limits")
    assert attempt(2) == 0
    recorder.refusal, settings.FLEET_RECORDINGS_ROBOT_BYTES = None, 0
    assert attempt(3) == 0
    settings.FLEET_RECORDINGS_ROBOT_BYTES = 1
    assert attempt(4) == 1
    outcomes = Record.objects.filter(kind="recording.begin", of__isnull=False).order_by("pk")
    assert [one.outcome for one in outcomes] == ["disk_full", "robot_quota", "accepted"]


def test_a_recording_that_broke_off_is_begun_again(
    booked: Any, recorder: FakeBridge, clock: list[float], supervisor: User, signed_in: Any
) -> None:
    booked(record=True)
    housekeeping = BookingRecorder()
    housekeeping.step(at(1))
    recorder.recording = None  # the bridge was started again
    clock[0] += LOOK_S / 2
    housekeeping.step(at(5))
    assert len(recorder.orders) == 1
    clock[0] += LOOK_S
    housekeeping.step(at(5))
    first, second = recorder.orders
    assert isinstance(second, LinkRecord) and second.seconds == 55 * 60
    assert second.recording != first.recording
    assert recorder.recording is not None
    recorder.recording = structs.replace(recorder.recording, recording=uuid4())  # its recorder was
    clock[0] += LOOK_S
    housekeeping.step(at(6))
    ended = signed_in(supervisor).delete(f"/api/v1/robots/tiago-1/recordings/{second.recording}")
    assert ended.status_code == 204
    for _ in range(3):
        clock[0] += LOOK_S
        housekeeping.step(at(7))
    assert recorder.orders[2:] == [LinkRecordEnd(second.recording)]


def test_the_recording_of_a_booking_replaces_one_by_hand(booked: Any, recorder: FakeBridge) -> None:
    recorder.recording = RecordingState(uuid4(), "by_hand", "Ben", ["/foo"], 0.0, 60.0)
    theirs = recorder.recording.recording
    booked(record=True)
    BookingRecorder().step(at(1))
    end, begin = recorder.orders
    assert end == LinkRecordEnd(theirs) and isinstance(begin, LinkRecord) and begin.topics == "all"
    ended = Record.objects.get(kind="recording.end", of=None)
    assert ended.parameters["because"] == "booking"


def test_an_answer_that_was_lost_is_found_again(booked: Any, recorder: FakeBridge) -> None:
    booked(record=True)
    BookingRecorder().step(at(1))
    Booking.objects.update(recorded_until=None)  # housekeeping was killed before it could note it
    BookingRecorder().step(at(2))
    assert len(recorder.orders) == 1
    assert Booking.objects.get().recorded_until == at(1) + timedelta(minutes=59)


def test_people_and_programs_ask_for_it_when_they_book(
    robot: Robot, operator: User, signed_in: Callable[..., Any]
) -> None:
    client, begins = signed_in(operator), timezone.now().replace(minute=0, second=0, microsecond=0)
    slots = [begins + timedelta(hours=hours) for hours in (24, 25, 26)]
    page = client.get(reverse("booking-new")).content.decode()
    assert 'name="record"' in page
    made = client.post(
        "/api/v1/bookings",
        {
            "robot": robot.slug,
            "starts_at": slots[0].isoformat(),
            "ends_at": slots[1].isoformat(),
            "record": True,
        },
        content_type="application/json",
    )
    assert made.json()["record"] is True
    assert Record.objects.get(kind="booking.make").parameters["record"] is True
    shown = client.get(reverse("booking", args=[made.json()["id"]])).content.decode()
    assert "from the first control in it until its end" in shown
