"""The people who are told of a lesson's moments."""

from datetime import timedelta

import pytest

from fleet.bookings.messages.moments import write_moments
from fleet.bookings.models import Notification
from robots.access.models import Enrolment
from tests.bookings.lessons.conftest import at

pytestmark = pytest.mark.django_db


def test_a_lesson_that_begins_is_told_to_everybody_in_it(lesson):
    write_moments(at(-4))
    told = set(Notification.objects.values_list("person__username", flat=True))
    people = {one.person.username for one in Enrolment.objects.filter(course=lesson.course)}
    assert told == people | {lesson.teacher.username}


def test_a_called_person_is_told_that_it_is_their_turn(lesson, students):
    lesson.join(students[0], students[1], minute=1)
    lesson.settle(2)
    [told] = Notification.objects.filter(subject__contains="your turn")
    assert (told.person, told.path) == (students[0], f"/robots/{lesson.robot.slug}/")
    assert told.until == at(2) + timedelta(seconds=90)
