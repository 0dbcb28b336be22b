"""One line for control: the people who wait, their order, and an offer of 30 s to the next."""

from datetime import UTC, datetime, timedelta

import pytest

from fleet.audit.models import Record
from fleet.bookings.models import Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.registry.models import RobotRole
from teleop.control import services
from teleop.control.changes import ControlRefused
from teleop.control.lease_checks import OFFER_S, WAITS_S, Tab
from teleop.control.selectors import lease_of, line_of
from teleop.control.waiting import line
from teleop.models import EndReason

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 1, 5, 12, 0, tzinfo=UTC)


def at(seconds):
    return NOW + timedelta(seconds=seconds)


def tab(person):
    return Tab(f"{person.username}-tab", f"{person.username}-sign-in", f"{person.username}-connection")


def take(robot, person, now=NOW, step=services.lease_take, **options):
    return step(robot_id=robot.id, user_id=person.id, tab=tab(person), highest_fence=0, now=now, **options)


def wait(robot, person, now=NOW):
    return line.line_join(robot_id=robot.id, user_id=person.id, tab=tab(person), now=now)


def give_back(robot, now=NOW):
    held = lease_of(robot.id)
    services.lease_end(
        robot_id=robot.id, session=held.session, reason=EndReason.RELEASED, user_id=held.user, now=now
    )


def refused(step, *arguments, **options):
    with pytest.raises(ControlRefused) as caught:
        step(*arguments, **options)
    return caught.value.refusal


@pytest.fixture
def third(robot, second_operator, django_user_model):
    """One more operator."""
    person = django_user_model.objects.create_user("third", full_name="Theo Third")
    RobotRole.objects.create(user=person, robot=robot, role="operator")
    return person


@pytest.fixture
def free_with_a_line(robot, operator, second_operator, third):
    """Two people wait, and the robot has become free."""
    take(robot, operator)
    wait(robot, second_operator, at(1))
    wait(robot, third, at(2))
    give_back(robot, at(3))
    assert line.offer_next(robot_id=robot.id, now=at(3))


def test_the_first_in_line_gets_30_s_and_nobody_else(
    robot, operator, second_operator, third, free_with_a_line
):
    for person in (operator, third):
        refusal = refused(take, robot, person, at(10))
        assert (refusal.code, refusal.figures["seconds"]) == ("next_in_line", 23.0)
        assert second_operator.display_name in refusal.text
        assert ("Ask for control" in refusal.text) == (person == operator)  # the third person already waits
    assert take(robot, second_operator, at(32.9)).user == second_operator.id
    assert [one.user for one in line_of(robot.id, at(10))] == [third.id]
    offer = Record.objects.get(kind="control.offer")
    assert offer.parameters["to"] == str(second_operator.pk)
    assert Record.objects.filter(kind="control.ask").latest("id").outcome == "granted"


def test_an_offer_that_nobody_takes_goes_to_the_next(robot, second_operator, third, free_with_a_line):
    Waiting.objects.update(seen_at=at(34))
    assert not line.offer_next(robot_id=robot.id, now=at(3 + OFFER_S - 1))
    assert line.offer_next(robot_id=robot.id, now=at(34))
    assert refused(take, robot, second_operator, at(35)).code == "next_in_line"
    assert take(robot, third, at(35)).user == third.id
    assert not Waiting.objects.exists()


def test_a_robot_that_somebody_drives_is_not_offered(robot, operator, second_operator):
    take(robot, operator)
    wait(robot, second_operator)
    assert not line.offer_next(robot_id=robot.id, now=at(1))
    assert line_of(robot.id, at(1))[0].offer_until is None


def test_people_wait_for_a_free_robot_that_is_offered(robot, operator, second_operator, free_with_a_line):
    wait(robot, operator, at(5))
    assert [one.user for one in line_of(robot.id, at(5))][-1] == operator.id
    take(robot, second_operator, at(6))
    give_back(robot, at(7))


def test_a_supervisor_takes_over_from_the_line_with_a_reason(
    robot, supervisor, second_operator, free_with_a_line
):
    assert refused(take, robot, supervisor, at(4)).code == "next_in_line"
    take(robot, supervisor, at(4), services.lease_take_over, reason="fire drill")
    assert Record.objects.get(kind="control.take_over").parameters["holder"] == str(second_operator.pk)


def test_a_slots_owner_does_not_wait(robot, operator, second_operator, third):
    take(robot, operator)
    wait(robot, second_operator, at(1))
    booking_make(robot=robot, person=third, slot=Slot(at(60), at(3660)), now=NOW)
    give_back(robot, at(61))
    Waiting.objects.update(seen_at=at(61))
    assert not line.offer_next(robot_id=robot.id, now=at(61))  # it is booked: nobody else may take it
    take(robot, third, at(62))
    assert [one.user for one in line_of(robot.id, at(62))] == [second_operator.id]


def test_a_lost_right_makes_room_for_the_next(robot, second_operator, third, operator):
    take(robot, operator)
    wait(robot, second_operator)
    wait(robot, third)
    RobotRole.objects.filter(user=second_operator).delete()
    give_back(robot)
    assert line.offer_next(robot_id=robot.id, now=at(1))
    assert take(robot, third, at(2)).user == third.id


def test_a_web_process_that_died_blocks_nobody(robot, operator, second_operator, third):
    take(robot, operator)
    wait(robot, second_operator)
    give_back(robot)
    assert take(robot, third, at(WAITS_S)).user == third.id


def test_a_free_robot_needs_no_waiting(robot, operator):
    assert refused(wait, robot, operator).code == "free"


def test_an_observer_cannot_wait(robot, operator, observer):
    take(robot, operator)
    assert refused(wait, robot, observer).code == "role_too_low"


def test_a_clock_that_was_set_back_lengthens_no_offer(
    robot, operator, second_operator, third, free_with_a_line
):
    earlier = at(-3600)
    assert line_of(robot.id, earlier) == []  # nobody, until their pages are seen again
    Waiting.objects.update(seen_at=earlier)
    line.line_tidy(now=earlier)
    assert [one.user for one in line_of(robot.id, earlier)] == [third.id]
    assert line.offer_next(robot_id=robot.id, now=earlier)
    assert take(robot, third, at(-3599)).user == third.id
