"""A course with a teacher and students, its lesson on one robot, and their tabs."""

from datetime import UTC, datetime, timedelta

import pytest

from fleet.bookings.lessons import turns
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment
from robots.registry.models import Role
from teleop.control import services
from teleop.control.lease_checks import Tab
from teleop.control.selectors import lease_of
from teleop.control.waiting.turns import turns_settle
from teleop.models import Lease

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


def at(minutes):
    return NOW + timedelta(minutes=minutes)


def tab(person):
    return Tab(f"{person.username}-tab", f"{person.username}-sign-in", f"{person.username}-connection")


class Class:
    """The lesson from 9:00 to 11:00 with turns of ten minutes. Times are minutes after 9:00."""

    def __init__(self, robot, course, teacher, students):
        self.robot, self.course, self.teacher, self.students = robot, course, teacher, students
        slot = Slot(at(0), at(120))
        self.lesson = booking_make(
            robot=robot, person=teacher, slot=slot, now=at(-60), lesson_of=course, turn_min=10, purpose="SLAM"
        )

    def join(self, *people, minute=0.0):
        for person in people:
            turns.turn_join(booking_id=self.lesson.pk, person=person, now=at(minute))

    def settle(self, minute):
        Lease.objects.exclude(session=None).update(seen_at=at(minute))
        return turns_settle(robot_id=self.robot.pk, now=at(minute))

    def take(self, person, minute, step=services.lease_take, **options):
        who = {"robot_id": self.robot.pk, "user_id": person.pk, "tab": tab(person)}
        return step(**who, highest_fence=0, now=at(minute), **options)

    def refused(self, *args, **options):
        with pytest.raises(services.ControlRefused) as caught:
            self.take(*args, **options)
        return caught.value.refusal

    def end(self, reason, minute, by=None):
        session = lease_of(self.robot.pk).session
        services.lease_end(
            robot_id=self.robot.pk, session=session, reason=reason, user_id=by and by.pk, now=at(minute)
        )

    def expire(self, minute):
        Lease.objects.exclude(session=None).update(seen_at=at(minute))
        services.lease_expire(robot_id=self.robot.pk, now=at(minute))

    @property
    def turns(self):
        """The line in its order: names and states."""
        return [(turn.person.username, turn.state) for turn in self.lesson.turns.select_related("person")]

    @property
    def turn(self):
        return self.lesson.turns.get(state__in=turns.OPEN)


@pytest.fixture
def course(robot, supervisor, django_user_model):
    days = {"starts_on": NOW.date(), "ends_on": NOW.date() + timedelta(days=3650)}
    made = Course.objects.create(name="HRI 2026", slug="hri", role=Role.OPERATOR, **days)
    made.robots.add(robot)
    for name in ("ada", "ben", "cem"):
        Enrolment.objects.create(course=made, person=django_user_model.objects.create_user(name))
    return made


@pytest.fixture
def teacher(course, django_user_model):
    person = django_user_model.objects.create_user("teacher", full_name="Tess Teacher")
    course.supervisors.add(person)
    return person


@pytest.fixture
def students(course, django_user_model):
    return list(django_user_model.objects.filter(enrolments__course=course).order_by("username"))


@pytest.fixture
def lesson(robot, course, teacher, students):
    return Class(robot, course, teacher, students)
