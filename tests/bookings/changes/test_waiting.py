"""The waiting list of a taken slot: order, offers, deadlines."""

from datetime import UTC, datetime, timedelta

import pytest

from fleet.audit.models import Record
from fleet.bookings.changes.waiting_list import (
    KEPT,
    MOST,
    forget_past,
    keep_waiting_lists,
    offer_accept,
    waiting_join,
    waiting_leave,
)
from fleet.bookings.messages import notifications
from fleet.bookings.models import Booking, State, Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.schedule import schedule_of
from fleet.bookings.services import BookingRefused, booking_cancel, booking_make

pytestmark = pytest.mark.django_db

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)
SLOT = Slot(NOW + timedelta(hours=4), NOW + timedelta(hours=5))


def at(hours):
    return NOW + timedelta(hours=hours)


@pytest.fixture
def taken(robot, operator):
    return booking_make(robot=robot, person=operator, slot=SLOT, now=NOW)


@pytest.fixture
def queue(robot, taken, second_operator, supervisor):
    """Two people wait for the slot: first the second operator, then the supervisor."""
    for number, person in enumerate((second_operator, supervisor)):
        waiting_join(robot=robot, person=person, slot=SLOT, now=NOW + timedelta(minutes=number))
    return taken


def cancel(booking, person, now=NOW):
    booking_cancel(booking_id=booking.pk, version=1, actor=person, now=now)


def offered():
    return Booking.objects.get(state=State.OFFERED)


def test_nobody_waits_for_a_free_slot_or_against_a_rule(robot, taken, second_operator, observer):
    free = Slot(at(6), at(7))
    for person, slot, code in ((second_operator, free, "free"), (observer, SLOT, "role_too_low")):
        with pytest.raises(BookingRefused) as caught:
            waiting_join(robot=robot, person=person, slot=slot, now=NOW)
        assert caught.value.refusal.code == code


def test_who_waits_and_leaves_is_on_record(robot, taken, second_operator):
    waiting = waiting_join(robot=robot, person=second_operator, slot=SLOT, now=NOW)
    waiting_join(robot=robot, person=second_operator, slot=SLOT, now=NOW)  # has no effect
    waiting_leave(person=second_operator, waiting_id=waiting.pk)
    found = Record.objects.filter(kind__startswith="booking.wait").order_by("pk")
    assert [(one.kind, one.actor_id) for one in found] == [
        ("booking.wait", str(second_operator.pk)),
        ("booking.wait_end", str(second_operator.pk)),
    ]


def test_the_first_who_waits_gets_the_offer_and_accepts(robot, queue, operator, second_operator, mailoutbox):
    second_operator.email = "olaf@example.org"
    second_operator.save()
    keep_waiting_lists(at(0.5))
    assert not Booking.objects.filter(state=State.OFFERED).exists()
    cancel(queue, operator, at(1))
    keep_waiting_lists(at(1))  # has no effect
    offer = offered()
    assert (offer.person, offer.offer_until) == (second_operator, at(2.5))
    notifications.send_notifications(at(1.1))
    assert "your turn" in mailoutbox[0].subject
    with pytest.raises(BookingRefused):  # the offer holds the slot
        booking_make(robot=robot, person=operator, slot=SLOT, now=at(1))
    assert schedule_of(robot, at(4.1)).current is None  # an offer gives no control
    offer_accept(booking_id=offer.pk, actor=second_operator, now=at(2))
    assert Booking.objects.get(pk=offer.pk).state == State.BOOKED
    kinds = Record.objects.filter(kind__in=["booking.offer", "booking.accept"]).values_list("kind", flat=True)
    assert sorted(kinds) == ["booking.accept", "booking.offer"]


def test_a_lapsed_offer_goes_to_the_next(queue, operator, second_operator, supervisor):
    cancel(queue, operator, at(1))
    late = offered()
    keep_waiting_lists(at(2.6))
    assert offered().person == supervisor
    assert not Waiting.objects.exists()
    with pytest.raises(BookingRefused) as caught:
        offer_accept(booking_id=late.pk, actor=second_operator, now=at(2.6))
    assert caught.value.refusal.code == "offer_over"


def test_only_its_person_accepts_an_offer(queue, operator, supervisor):
    cancel(queue, operator)
    with pytest.raises(BookingRefused):
        offer_accept(booking_id=offered().pk, actor=supervisor, now=at(1))


def test_a_slot_that_began_is_waited_for_no_more(queue, operator):
    cancel(queue, operator, at(3.9))
    keep_waiting_lists(at(4))
    assert not Booking.objects.filter(state=State.OFFERED).exists()
    forget_past(at(4) + KEPT)
    assert not Waiting.objects.exists()


def test_a_clock_that_jumped_ahead_and_back_loses_no_place(queue, operator, second_operator):
    keep_waiting_lists(at(24))
    forget_past(at(24))
    cancel(queue, operator)
    assert offered().person == second_operator


def test_who_waits_for_a_taken_slot_costs_nothing(
    robot, taken, second_operator, django_assert_max_num_queries
):
    for number in range(MOST):
        slot = Slot(SLOT.starts_at + timedelta(minutes=number), SLOT.ends_at)
        waiting_join(robot=robot, person=second_operator, slot=slot, now=NOW)
    with django_assert_max_num_queries(3):  # runs every second, for hundreds of people
        keep_waiting_lists(at(0.5))
