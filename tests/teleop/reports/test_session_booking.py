"""The pages of booking, line and control session link to each other."""

from datetime import timedelta

import pytest
from django.utils import timezone

from fleet.bookings.models import Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make, booking_move
from teleop.control.changes import ControlRefused
from teleop.control.lease_checks import Tab
from teleop.control.services import lease_hand_over, lease_take, lease_take_over
from teleop.control.waiting.line import line_join

pytestmark = pytest.mark.django_db(transaction=True)


def test_a_session_shows_its_booking_and_its_line(robot, operator, second_operator, supervisor, signed_in):
    now = timezone.now()
    slot = Slot(now + timedelta(minutes=1), now + timedelta(minutes=61))
    booked = booking_make(robot=robot, person=operator, slot=slot, now=now, purpose="wheel odometry")
    slot = Slot(now, now + timedelta(minutes=60))
    booking_move(
        booking_id=booked.pk,
        version=1,
        slot=slot,
        actor=supervisor,
        now=now,
        override="the lesson is earlier",
    )
    common = {"robot_id": robot.id, "tab": Tab("tab", "sign-in", "connection")}
    with pytest.raises(ControlRefused):
        lease_take(**common, user_id=second_operator.id, highest_fence=0, now=timezone.now())
    taken = lease_take(**common, user_id=operator.id, highest_fence=0, now=timezone.now())
    line_join(robot_id=robot.id, user_id=second_operator.id, tab=Tab("b", "b", "other"), now=timezone.now())
    page = signed_in(operator).get(f"/sessions/{taken.session}/").content.decode()
    for words in ("wheel odometry", "booking moved", "Sue Pervisor", "the lesson is earlier"):
        assert words in page, words
    assert f'href="/bookings/{booked.pk}/"' in page
    booking = signed_in(operator).get(f"/bookings/{booked.pk}/").content.decode()
    assert f'href="/sessions/{taken.session}/"' in booking
    stranger = signed_in(second_operator).get(f"/bookings/{booked.pk}/").content.decode()
    assert f"/sessions/{taken.session}/" not in stranger

    given = lease_hand_over(
        **common,
        user_id=operator.id,
        request_id=Waiting.objects.get().pk,
        highest_fence=0,
        now=timezone.now(),
    )
    later = signed_in(second_operator).get(f"/sessions/{given.session}/").content.decode()
    assert "control asked for" in later
    later = signed_in(supervisor).get(f"/sessions/{given.session}/").content.decode()
    assert "guest of a booking by a hand-over of control" in later


def test_a_session_in_another_persons_slot_leads_to_it(robot, operator, supervisor, signed_in):
    now = timezone.now()
    slot = Slot(now, now + timedelta(minutes=60))
    booked = booking_make(robot=robot, person=operator, slot=slot, now=now)
    common = {"robot_id": robot.id, "highest_fence": 0}
    own = lease_take(**common, user_id=operator.id, tab=Tab("a", "a", "a"), now=timezone.now())
    over = lease_take_over(
        **common,
        user_id=supervisor.id,
        tab=Tab("b", "b", "b"),
        now=timezone.now(),
        reason="the robot stands in the door",
    )
    page = signed_in(supervisor).get(f"/sessions/{over.session}/").content.decode()
    assert f'href="/bookings/{booked.pk}/"' in page
    assert operator.display_name in page
    booking = signed_in(supervisor).get(f"/bookings/{booked.pk}/").content.decode()
    assert all(f"/sessions/{one.session}/" in booking for one in (own, over))
    mine = signed_in(operator).get(f"/bookings/{booked.pk}/").content.decode()
    assert f"/sessions/{own.session}/" in mine
    assert f"/sessions/{over.session}/" not in mine
