"""Bookings to come are freed when their person loses the right to drive."""

from datetime import timedelta

import pytest
from django.core.management import call_command
from django.db import DatabaseError
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.losses import lost_rights
from fleet.bookings.losses.lost_rights import bookings_free_lost
from fleet.bookings.models import Booking, Notification, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make, booking_move
from robots.access import services as access
from robots.access.enrolment import unenrol
from robots.access.models import Course, Enrolment, Qualification, RobotGroup
from robots.registry.models import RobotRole, Role

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def student(robot):
    """A student who may drive by a course that has the robot by its group."""
    person = User.objects.create_user("stu", "stu@example.org", full_name="Stu Dent")
    today = timezone.now().date()
    course = Course.objects.create(
        name="HRI", slug="hri", starts_on=today - timedelta(days=1), ends_on=today + timedelta(days=20)
    )
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.add(robot)
    course.groups.add(group)
    Enrolment.objects.create(course=course, person=person)
    return person


def book(robot, person, days=2, **options):
    starts = timezone.now().replace(microsecond=0) + timedelta(days=days)
    slot = Slot(starts, starts + timedelta(hours=1))
    return booking_make(robot=robot, person=person, slot=slot, now=timezone.now(), **options)


def state_of(booking):
    booking.refresh_from_db()
    return State(booking.state)


def lose_role(person, staff):
    role = RobotRole.objects.select_related("robot").get(user=person)
    access.role_set(robot=role.robot, user=person, role=Role.OBSERVER, actor=staff)


def close_account(person, staff):
    person.is_active = False
    person.save()


@pytest.mark.parametrize(("lose", "why"), [(lose_role, "role_too_low"), (close_account, "account_inactive")])
def test_a_lost_role_frees_bookings_to_come(robot, operator, staff, lose, why):
    operator.email = "olga@lab.example"
    operator.save()
    mine, other = book(robot, operator), book(robot, staff, days=3)
    lose(operator, staff)
    assert (state_of(mine), state_of(other)) == (State.CANCELLED, State.BOOKED)
    ended = Record.objects.get(kind="booking.cancel")
    assert (ended.actor_id, ended.parameters["why"]) == (None, why)
    assert "cancelled" in Notification.objects.get().subject
    book(robot, staff)  # the slot is free


def leave(course, student, staff):
    unenrol(course=course, people=[student], actor=staff)


def archive(course, student, staff):
    access.course_archive(course=course, archived=True, actor=staff)


def end_early(course, student, staff):
    course.ends_on = timezone.now().date() + timedelta(days=1)
    lists = {"robots": [], "groups": course.groups.all(), "supervisors": []}
    access.course_save(course=course, **lists, actor=staff)


def move_the_robot(course, student, staff):
    access.group_save(group=course.groups.get(), robots=[], actor=staff)


def demand_an_induction(course, student, staff):
    new = Qualification(name="Induction", slug="induction")
    access.qualification_save(qualification=new, robots=[], groups=course.groups.all(), actor=staff)


@pytest.mark.parametrize("change", [leave, archive, end_early, move_the_robot, demand_an_induction])
def test_a_change_of_the_course_frees_its_bookings(robot, student, staff, change):
    booking = book(robot, student)
    change(Course.objects.get(), student, staff)
    assert state_of(booking) is State.CANCELLED


def test_a_revoked_qualification_frees_bookings(robot, student, staff):
    new = Qualification(name="Induction", slug="induction")
    access.qualification_save(qualification=new, robots=[robot], groups=[], actor=staff)
    access.qualification_grant(qualification=new, people=[student], expires_at=None, actor=staff)
    booking = book(robot, student)
    access.qualification_revoke(qualification=new, people=[student], actor=staff)
    assert state_of(booking) is State.CANCELLED


def test_what_staff_booked_against_the_policy_stays(robot, stranger, staff):
    booking = book(robot, stranger, actor=staff, override="gets the role on Monday")
    assert bookings_free_lost(None, timezone.now()) == 0
    assert state_of(booking) is State.BOOKED


def test_a_change_that_takes_nothing_frees_nothing(robot, operator, staff):
    booking = book(robot, operator)
    access.role_set(robot=robot, user=operator, role=Role.SUPERVISOR, actor=staff)
    assert bookings_free_lost(None, timezone.now()) == 0
    assert state_of(booking) is State.BOOKED


def test_housekeeping_frees_what_a_dead_process_left(robot, operator):
    booking = book(robot, operator)
    RobotRole.objects.filter(user=operator).delete()  # not by the services: no process is notified
    call_command("run_housekeeping", "--once")
    assert state_of(booking) is State.CANCELLED


def test_many_bookings_are_freed_in_small_transactions(robot, operator, monkeypatch):
    first, second = book(robot, operator), book(robot, operator, days=3)
    RobotRole.objects.filter(user=operator).delete()
    free = lost_rights.free

    def fail_at_last(found, now):
        if not Booking.objects.filter(state=State.CANCELLED).exists():
            return free(found, now)
        raise DatabaseError("away")

    monkeypatch.setattr(lost_rights, "AT_ONCE", 1)
    monkeypatch.setattr(lost_rights, "free", fail_at_last)
    with pytest.raises(DatabaseError):
        bookings_free_lost(None, timezone.now())
    assert {state_of(first), state_of(second)} == {State.CANCELLED, State.BOOKED}


@pytest.mark.parametrize("begun", [False, True])
def test_a_slot_ends_where_a_qualification_expires(robot, student, second_operator, staff, begun):
    new = Qualification(name="Induction", slug="induction")
    access.qualification_save(qualification=new, robots=[robot], groups=[], actor=staff)
    grant = {"qualification": new, "people": [student, second_operator], "actor": staff}
    access.qualification_grant(**grant, expires_at=None)
    booking = book(robot, student, days=0 if begun else 2)
    ends = booking.starts_at + timedelta(minutes=30)
    access.qualification_grant(**grant | {"people": [student]}, expires_at=ends)
    assert (state_of(booking), booking.held_until) == (State.BOOKED, ends)
    assert "shortened" in Notification.objects.get().subject
    assert Record.objects.get(kind="booking.move").parameters["why"] == "unqualified"
    rest = Slot(ends, ends + timedelta(minutes=30))
    with pytest.raises(BookingRefused, match="A qualification that TIAGo 1 demands ends"):
        booking_move(
            booking_id=booking.pk,
            version=booking.version,
            slot=Slot(booking.starts_at, rest.ends_at),
            actor=student,
            now=timezone.now(),
        )
    booking_make(robot=robot, person=second_operator, slot=rest, now=timezone.now())
