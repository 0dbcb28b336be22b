"""A change by which a line skips people names them first, and undo puts them back into the line."""

from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.lessons.turns import line_fill, turn_skip, turns_step
from fleet.bookings.models import Booking, Change, Notification, Shared, Turn
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant
from tests.bookings.losses.support import confirm

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def students():
    return [User.objects.create_user(name, full_name=f"{name} Student") for name in ("Ada", "Ben")]


@pytest.fixture
def lesson(robot, staff, students):
    """A lesson that runs, with both students in line."""
    today, now = timezone.localdate(), timezone.now()
    course = Course.objects.create(
        name="HRI", slug="hri", starts_on=today, ends_on=today + timedelta(days=20)
    )
    course.robots.add(robot)
    for person in students:
        Enrolment.objects.create(course=course, person=person)
    times = {"starts_at": now - timedelta(minutes=5), "ends_at": now + timedelta(hours=1)}
    held = {"held_until": times["ends_at"], "made_at": now, "used_at": now}
    made = Booking.objects.create(
        robot=robot, person=staff, course=course, shared=Shared.COURSE, turn_min=5, **times, **held
    )
    line_fill(booking_id=made.pk, actor=staff, now=now)
    return made


@pytest.fixture
def door(staff):
    client = Client()
    client.force_login(staff)
    return client


def demand(door, robot):
    return door.post(reverse("qualifications"), {"new-name": "Induction", "new-robots": str(robot.pk)})


def states():
    return list(Turn.objects.order_by("person__username").values_list("person__username", "state"))


def test_a_new_demand_names_whom_the_line_skips(door, robot, lesson, students):
    asked = demand(door, robot)
    assert asked.status_code == 409
    assert "takes time from 2 people" in asked.text and "skipped in the line" in asked.text
    assert all(person.display_name in asked.text for person in students)
    confirm(door, asked)
    told = Notification.objects.filter(subject__contains="skipped").order_by("person__username")
    assert [one.person for one in told] == students
    turns_step(robot=robot, now=timezone.now() + timedelta(minutes=2))  # Ada was called before
    assert states() == [("Ada", "refused"), ("Ben", "refused")]

    page = door.get(reverse("change", args=[Change.objects.get().pk])).text
    assert all(person.display_name in page for person in students)
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    assert sorted(state for _name, state in states()) == ["called", "waiting"]
    assert [one.parameters["why"] for one in Record.objects.filter(kind="turn.join")] == ["undo", "undo"]
    assert Notification.objects.filter(subject__contains="given back").count() == 2


def test_who_is_qualified_later_comes_back_with_everybody(door, robot, staff, lesson, students):
    now = timezone.now()
    confirm(door, demand(door, robot))
    turns_step(robot=robot, now=now + timedelta(minutes=2))  # Ada was called before
    for person in students:
        QualificationGrant.objects.create(qualification=Qualification.objects.get(), person=person)
    assert [line_fill(booking_id=lesson.pk, actor=staff, now=now) for _press in range(2)] == [2, 0]
    skipped = Turn.objects.filter(state=Turn.State.WAITING).first()
    turn_skip(booking_id=lesson.pk, turn_id=skipped.pk, actor=staff, now=now)
    assert line_fill(booking_id=lesson.pk, actor=staff, now=now) == 0, "who is ill stays away"


def test_who_has_the_qualification_is_not_named(door, robot, lesson, students):
    needed = Qualification.objects.create(name="Induction", slug="induction")
    QualificationGrant.objects.create(qualification=needed, person=students[0])
    needed.robots.add(robot)  # so the line skips the other one already
    form = {"entry": "induction", "induction-name": "Laser", "induction-robots": str(robot.pk)}
    assert door.post(reverse("qualifications"), form).status_code == 302


def test_a_lesson_that_ends_is_one_loss(door, lesson, students):
    asked = door.post(reverse("course-archive", args=["hri"]), {"archived": "1"})
    assert "and 2 people who share it" in asked.text and "skipped in the line" not in asked.text
