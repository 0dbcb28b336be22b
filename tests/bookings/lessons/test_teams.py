"""Bookings for named people, and guests by a hand-over of control. The slot stays its owner's."""

import pytest

from fleet.audit.models import Record
from fleet.bookings.models import Booking, BookingMember, Policy
from fleet.bookings.rules import Slot
from fleet.bookings.services import (
    BookingRefused,
    booking_hand,
    booking_make,
    booking_move,
    robots_locked,
    team_named,
)
from robots.access.services import role_set
from robots.registry.models import Role
from teleop.control import services
from teleop.control.selectors import lease_of
from teleop.control.waiting import line
from tests.bookings.lessons.conftest import at, tab

pytestmark = pytest.mark.django_db(transaction=True)


def book(robot, person, **options):
    return booking_make(robot=robot, person=person, slot=Slot(at(0), at(60)), now=at(-60), **options)


def take(robot, person, minute, step=services.lease_take, **options):
    who = {"robot_id": robot.id, "user_id": person.id, "tab": tab(person)}
    return step(**who, highest_fence=0, now=at(minute), **options)


def codes(*args, **options):
    with pytest.raises(BookingRefused) as caught:
        book(*args, **options)
    return [one.code for one in caught.value.refusals]


def test_each_of_a_team_drives_in_its_booking(robot, operator, second_operator, supervisor):
    booking = book(robot, operator, team=[second_operator])
    assert booking.shared == "people"
    assert take(robot, second_operator, 1).term_ends_at == at(60)
    booking.refresh_from_db()
    assert booking.used_at == at(1)
    assert take(robot, operator, 1.1, services.lease_take_over, reason="").user == operator.pk
    assert Record.objects.filter(kind="control.take_over").count() == 1


def test_a_team_has_two_to_four_people_who_may_drive(
    robot, operator, second_operator, observer, django_user_model
):
    many = [django_user_model.objects.create_user(f"m{number}") for number in range(4)]
    for person in many:
        role_set(robot=robot, user=person, role=Role.OPERATOR, actor=None)
    assert codes(robot, operator, team=many) == ["team_size"]
    assert codes(robot, operator, team=[operator]) == ["team_size"]
    assert codes(robot, operator, team=[observer]) == ["may_not_drive"]
    assert codes(robot, operator, turn_min=10) == ["invalid"]
    assert codes(robot, operator, team=[second_operator], turn_min=241) == ["invalid"]
    assert book(robot, operator, team=many[:3], turn_min=10).members.count() == 3
    for name in ("nobody", observer.username):
        with pytest.raises(BookingRefused) as caught:
            team_named([name], robot, at(0))
        assert caught.value.refusal.code == "no_colleague"


def test_a_team_drives_on_when_its_slot_begins(robot, operator, second_operator):
    book(robot, operator, team=[second_operator])
    assert take(robot, second_operator, -2).term_ends_at == at(
        13
    )  # a term of free time, not cut at the start


def test_who_gets_control_in_a_slot_is_its_guest(robot, operator, second_operator, supervisor):
    booking = book(robot, operator)
    take(robot, operator, 1)
    request = line.line_join(
        robot_id=robot.id, user_id=second_operator.id, tab=tab(second_operator), now=at(1.1)
    )
    given = take(robot, operator, 1.1, services.lease_hand_over, request_id=request)
    assert (given.user, given.term_ends_at) == (second_operator.id, at(60))
    booking.refresh_from_db()
    assert (booking.person, booking.ends_at, booking.version) == (operator, at(60), 1)
    assert list(BookingMember.objects.values_list("person", flat=True)) == [second_operator.pk]
    assert Record.objects.get(kind="booking.guest").parameters["to"] == str(second_operator.pk)
    # The owner takes it back without a reason; not from a supervisor, who had one.
    assert take(robot, operator, 1.2, services.lease_take_over, reason="").user == operator.id
    take(robot, supervisor, 1.3, services.lease_take_over, reason="fire drill")
    with pytest.raises(services.ControlRefused) as caught:
        take(robot, operator, 1.4, services.lease_take_over, reason="")
    assert caught.value.refusal.code == "no_reason"
    assert lease_of(robot.id).user == supervisor.id


def test_a_guest_makes_no_guests(robot, operator, second_operator, django_user_model):
    book(robot, operator, team=[second_operator])
    third = django_user_model.objects.create_user("third")
    role_set(robot=robot, user=third, role=Role.OPERATOR, actor=None)
    take(robot, second_operator, 1)
    request = line.line_join(robot_id=robot.id, user_id=third.id, tab=tab(third), now=at(1.1))
    with pytest.raises(services.ControlRefused) as caught:
        take(robot, second_operator, 1.1, services.lease_hand_over, request_id=request)
    assert caught.value.refusal.code == "booked"


def test_a_team_whose_booking_is_handed_on_keeps_its_former_owner(robot, operator, second_operator):
    booking = book(robot, operator, team=[second_operator])
    booking_hand(booking_id=booking.pk, version=1, to=second_operator, actor=operator, now=at(-30))
    booking = Booking.objects.get()
    assert booking.person == second_operator
    assert [one.person for one in booking.members.all()] == [operator]


def test_a_lesson_needs_no_approval_of_its_teacher(robot, course, teacher):
    Policy.objects.create(robot=robot, needs_approval=True)
    assert book(robot, teacher, lesson_of=course, turn_min=10).state == "booked"


def test_a_team_moves_only_to_a_robot_that_all_may_drive(robot, other_robot, operator, second_operator):
    booking = book(robot, operator, team=[second_operator])
    role_set(robot=other_robot, user=operator, role=Role.OPERATOR, actor=None)
    seen = {"booking_id": booking.pk, "version": 1, "actor": operator, "now": at(-60)}
    with pytest.raises(BookingRefused) as caught, robots_locked([robot.pk, other_robot.pk], at(-60)):
        booking_move(slot=Slot(at(0), at(60)), robot=other_robot, **seen)
    assert caught.value.refusal.code == "may_not_drive"
