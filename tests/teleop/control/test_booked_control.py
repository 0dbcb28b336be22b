"""Control follows bookings: a slot's owner drives, all others wait, and no term outlives a slot."""

from datetime import UTC, datetime, timedelta

import pytest

from fleet.audit.models import Record
from fleet.bookings.models import Booking, OutOfService, Policy
from fleet.bookings.rules import Slot
from fleet.bookings.schedule import schedule_of
from fleet.bookings.services import booking_approve, booking_cancel, booking_make
from robots.registry.models import Role
from robots.shared.wire import Refusal
from teleop.control import services
from teleop.control.lease_checks import Tab
from teleop.control.rules import Subject, permit_for, schedule_for
from teleop.control.selectors import end_notes, lease_of
from teleop.control.status import ControlStatus, Rights
from teleop.models import ControlSession, Lease

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 1, 5, 12, 0, tzinfo=UTC)


def at(minutes):
    return NOW + timedelta(minutes=minutes)


def tab(person):
    return Tab(f"{person.username}-tab", f"{person.username}-sign-in", f"{person.username}-connection")


def book(robot, person, begins_min, minutes=60, now=NOW):
    slot = Slot(at(begins_min), at(begins_min + minutes))
    return booking_make(robot=robot, person=person, slot=slot, now=now)


def take(robot, person, now=NOW, step=services.lease_take, **options):
    return step(robot_id=robot.id, user_id=person.id, tab=tab(person), highest_fence=0, now=now, **options)


def refused(*args, **options):
    with pytest.raises(services.ControlRefused) as caught:
        take(*args, **options)
    return caught.value.refusal


def test_only_the_owner_takes_control_in_a_slot(robot, operator, second_operator):
    book(robot, operator, 0)
    refusal = refused(robot, second_operator, at(1))
    assert (refusal.code, refusal.rule) == ("booked", "booking")
    assert "until 13:00" in refusal.text
    taken = take(robot, operator, at(1))
    assert taken.term_ends_at == at(60)  # the whole slot, without renewals
    assert Booking.objects.get().used_at == at(1)


def test_slots_of_one_person_that_touch_are_one_term(robot, operator):
    book(robot, operator, 0)
    book(robot, operator, 60)
    assert take(robot, operator, at(1)).term_ends_at == at(120)


@pytest.mark.parametrize("first", ["the clock", "the owner of the slot"])
def test_free_time_ends_when_another_slot_begins(robot, operator, second_operator, first):
    book(robot, operator, 10)
    taken = take(robot, second_operator)
    assert taken.term_ends_at == at(10)
    if first == "the clock":
        services.lease_expire(robot_id=robot.id, now=at(10))
    else:
        take(robot, operator, at(10))
    session = ControlSession.objects.get(pk=taken.session)
    assert session.end_reason == "slot"
    assert end_notes([session.pk])[session.pk] == f"{operator.display_name}’s slot began."


def test_the_end_of_ones_own_slot_is_named(robot, operator):
    book(robot, operator, 0)
    taken = take(robot, operator, at(1))
    services.lease_expire(robot_id=robot.id, now=at(60))
    assert end_notes([taken.session])[taken.session] == "Your slot ended."


def test_control_ends_when_an_out_of_service_period_begins(robot, operator, supervisor):
    OutOfService.objects.create(robot=robot, starts_at=at(10), ends_at=at(20), why="repair")
    book(robot, operator, 30)
    taken = take(robot, operator)
    assert taken.term_ends_at == at(10)
    services.lease_expire(robot_id=robot.id, now=at(10))
    assert end_notes([taken.session])[taken.session] == "The robot is out of service now (repair)."
    assert take(robot, supervisor, at(11)).term_ends_at == at(26)  # a supervisor may drive it for the repair


def test_keeping_control_lengthens_ones_slot(robot, operator, second_operator):
    book(robot, operator, 0)
    taken = take(robot, operator, at(1))
    renew = {"robot_id": robot.id, "user_id": operator.id, "tab": tab(operator), "now": at(1.1)}
    services.lease_renew(**renew)
    assert lease_of(robot.id).term_ends_at == at(75)
    book(robot, second_operator, 80)
    with pytest.raises(services.ControlRefused) as caught:
        services.lease_renew(**renew)
    assert caught.value.refusal.code == "taken"
    assert lease_of(robot.id).session == taken.session


def test_a_robot_for_booked_time_only_is_closed(robot, operator, supervisor):
    Policy.objects.create(robot=robot, free_time=False)
    assert refused(robot, operator).code == "book_first"
    take(robot, supervisor)


def test_an_unused_slot_is_free_time_after_the_grace(robot, operator, second_operator):
    book(robot, operator, 0)
    assert refused(robot, second_operator, at(14)).code == "booked"
    take(robot, second_operator, at(15))


def test_a_supervisor_takes_a_slot_over_with_a_reason(robot, operator, supervisor):
    book(robot, operator, 0)
    assert refused(robot, supervisor, at(1)).code == "booked"
    assert refused(robot, supervisor, at(1), services.lease_take_over, reason="   ").code == "no_reason"
    take(robot, supervisor, at(1), services.lease_take_over, reason="fire drill")
    record = Record.objects.get(kind="control.take_over")
    assert record.parameters["holder"] == str(operator.id)
    assert record.content.text == "fire drill"


def test_an_out_of_service_period_stops_all_but_supervisors(robot, operator, supervisor):
    OutOfService.objects.create(robot=robot, starts_at=at(-5), why="repair", note="new wheel")
    refusal = refused(robot, operator)
    assert refusal.code == "out_of_service"
    assert "until further notice (repair: new wheel)" in refusal.text
    take(robot, supervisor)


def read_as_the_hub_does(robot, person, now, role=Role.OPERATOR):
    """Read the status of control for the holder's page, and fit the lease to the slot as the hub does."""
    lease = lease_of(robot.id)
    schedule = schedule_for(person.id, schedule_of(robot, now), lease, now)
    rights = Rights(True, role, permit_for(Subject(person, robot, role, schedule, now)))
    status = ControlStatus(now, lease, [], {}, {(person.id, "key"): rights}, schedule_of(robot, now))
    if (until := status.moved_term_end()) is not None:
        services.lease_fit_slot(robot_id=robot.id, before=lease, until=until, now=now)


def permit(robot, person, now, role=Role.OPERATOR):
    return permit_for(Subject(person, robot, role, schedule_of(robot, now), now))


def test_a_driver_whose_slot_begins_keeps_control_for_it(robot, operator, second_operator):
    take(robot, operator)
    book(robot, operator, 5)
    read_as_the_hub_does(robot, operator, at(5.1))
    assert lease_of(robot.id).term_ends_at == at(65)
    assert Booking.objects.get().used_at == at(5.1)
    assert isinstance(permit(robot, second_operator, at(40)), Refusal)  # no grace time ends a slot in use


def test_a_slot_booked_during_control_shortens_the_term(robot, operator, second_operator):
    assert take(robot, operator).term_ends_at == at(15)
    book(robot, second_operator, 5)
    read_as_the_hub_does(robot, operator, at(1))
    assert lease_of(robot.id).term_ends_at == at(5)


@pytest.mark.parametrize("begins", [1, 3])
def test_a_slot_booked_for_now_warns_the_driver_5_minutes(robot, operator, second_operator, begins):
    take(robot, operator)
    book(robot, second_operator, begins, now=at(1))
    read_as_the_hub_does(robot, operator, at(begins))
    assert lease_of(robot.id).term_ends_at == at(6)
    Lease.objects.update(seen_at=at(6))  # the page is seen all the time
    me = {"robot_id": robot.id, "user_id": operator.id, "tab": tab(operator), "now": at(4)}
    services.lease_renew(**me)  # does not extend the term
    services.lease_resume(**me)
    assert lease_of(robot.id).term_ends_at == at(6)
    Lease.objects.update(seen_at=at(6))
    assert refused(robot, second_operator, at(5)).code == "held"
    assert take(robot, second_operator, at(6)).term_ends_at == at(begins + 60)


@pytest.mark.parametrize(("lasts", "begins"), [(4, 2), (9, 4.5), (10, 5)])
def test_of_a_short_slot_booked_for_now_its_owner_gets_half(robot, operator, second_operator, lasts, begins):
    Policy.objects.create(robot=robot, shortest_min=1)
    take(robot, operator)
    book(robot, second_operator, 1, lasts, now=at(1))
    read_as_the_hub_does(robot, operator, at(1))
    assert lease_of(robot.id).term_ends_at == at(1 + begins)
    assert take(robot, second_operator, at(1 + begins)).term_ends_at == at(1 + lasts)


def test_grace_time_of_a_slot_booked_for_now_covers_the_warning(robot, operator, second_operator):
    Policy.objects.create(robot=robot, grace_min=5)
    take(robot, operator)
    book(robot, second_operator, 1, now=at(1.5))  # lapses at 6 if it is not used
    read_as_the_hub_does(robot, operator, at(1.5))
    assert lease_of(robot.id).term_ends_at == at(3.75)
    assert take(robot, second_operator, at(3.75)).term_ends_at == at(61)


def test_a_slot_that_was_booked_before_control_is_no_surprise(robot, operator, second_operator):
    book(robot, second_operator, 2)
    assert take(robot, operator, at(1)).term_ends_at == at(2)
    read_as_the_hub_does(robot, operator, at(1.5))
    assert lease_of(robot.id).term_ends_at == at(2)


def test_control_does_not_outlive_a_slot_that_is_given_up(robot, operator):
    booking = book(robot, operator, 0, 240)
    assert take(robot, operator, at(1)).term_ends_at == at(240)
    booking_cancel(booking_id=booking.pk, version=booking.version, actor=operator, now=at(2))
    read_as_the_hub_does(robot, operator, at(2))
    assert lease_of(robot.id).term_ends_at == at(17)  # a term of free time


def test_a_slot_booked_for_now_ends_a_supervisors_free_time(robot, operator, supervisor):
    taken = take(robot, supervisor)
    book(robot, operator, 2, now=at(2))
    read_as_the_hub_does(robot, supervisor, at(7.01), Role.SUPERVISOR)
    services.lease_expire(robot_id=robot.id, now=at(7.02))
    assert lease_of(robot.id) is None
    assert end_notes([taken.session])[taken.session] == f"{operator.display_name}’s slot began."
    take(robot, supervisor, at(8), services.lease_take_over, reason="fire drill")
    read_as_the_hub_does(robot, supervisor, at(9), Role.SUPERVISOR)
    assert lease_of(robot.id).term_ends_at == at(23)


def test_keeping_control_lengthens_the_last_of_slots_that_touch(robot, operator):
    book(robot, operator, 0)
    book(robot, operator, 60)
    take(robot, operator, at(1))
    services.lease_renew(robot_id=robot.id, user_id=operator.id, tab=tab(operator), now=at(1.1))
    assert lease_of(robot.id).term_ends_at == at(135)


def test_a_slot_approved_late_ends_a_supervisors_free_time(robot, operator, supervisor, staff):
    Policy.objects.create(robot=robot, needs_approval=True)
    booking = book(robot, operator, 0)
    take(robot, supervisor, at(1))
    booking_approve(booking_id=booking.pk, version=booking.version, actor=staff, now=at(2))
    read_as_the_hub_does(robot, supervisor, at(2), Role.SUPERVISOR)
    assert lease_of(robot.id).term_ends_at == at(7)
