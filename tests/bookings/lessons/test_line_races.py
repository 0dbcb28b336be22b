"""Fifty people at one line at the same moment. Run on SQLite and, with FLEET_DATABASE_URL, PostgreSQL."""

import pytest
from django.db import OperationalError

from fleet.bookings.lessons import turns
from fleet.bookings.models import Booking
from robots.access.models import Enrolment
from teleop.control import services
from teleop.control.changes import ControlRefused, NotStored
from teleop.control.selectors import lease_of
from teleop.control.waiting.turns import turns_settle
from tests.bookings.lessons.conftest import at, tab
from tests.bookings.test_races import all_at_once

pytestmark = pytest.mark.django_db(transaction=True)

PEOPLE = 50


def pressed_again(step):
    """Do it again while the database is busy: SQLite has one writer at a time, and fifty wait for it here."""
    while True:
        try:
            return step()
        except OperationalError:
            continue
        except NotStored as error:
            if not error.refusal.code.startswith("database_"):
                raise


def test_of_fifty_who_join_and_are_called_at_once_one_has_the_turn(lesson, course, django_user_model):
    people = [django_user_model.objects.create_user(f"s{number:02}") for number in range(PEOPLE)]
    Enrolment.objects.bulk_create(Enrolment(course=course, person=person) for person in people)
    robot_id, booking_id = lesson.robot.pk, lesson.lesson.pk

    def join_and_take(person):
        here = {"robot_id": robot_id, "now": at(1)}
        pressed_again(lambda: turns.turn_join(booking_id=booking_id, person=person, now=at(1)))
        pressed_again(lambda: turns_settle(**here))
        pressed_again(
            lambda: services.lease_take(user_id=person.pk, tab=tab(person), highest_fence=0, **here)
        )

    errors = all_at_once([lambda person=person: join_and_take(person) for person in people])
    assert {type(error) for error in errors} == {ControlRefused}
    assert {error.refusal.code for error in errors} <= {"not_your_turn", "held"}
    assert len(errors) == PEOPLE - 1
    assert lesson.lesson.turns.filter(state__in=turns.OPEN).count() == 1
    assert lesson.turn.person_id == lease_of(robot_id).user
    assert lesson.lesson.turns.filter(state="waiting").count() == PEOPLE - 1
    numbers = list(lesson.lesson.turns.values_list("number", flat=True))
    assert len(set(numbers)) == PEOPLE
    assert Booking.objects.get().person == lesson.teacher  # whatever hands control passed through


def test_one_is_called_by_many_who_look_at_the_same_moment(lesson, students):
    lesson.join(*students)
    assert all_at_once([lambda: turns_settle(robot_id=lesson.robot.pk, now=at(1))] * 8) == []
    assert [state for _name, state in lesson.turns] == ["called", "waiting", "waiting"]
