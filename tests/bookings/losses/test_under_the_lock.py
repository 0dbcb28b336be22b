"""A change that takes time is made with few queries, however many bookings it takes: others wait for its lock."""

from datetime import timedelta
from threading import Thread

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.losses.rights import Wanted, wishes_of
from fleet.bookings.losses.undo import undo
from fleet.bookings.losses.weighing import Seen, weigh
from fleet.bookings.models import Booking, Change, Notification, State
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import wish_of
from robots.access.enrolment import unenrol
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant
from robots.registry.models import RobotRole, Role
from tests.bookings.losses.support import confirm

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def course(robot, other_robot):
    today = timezone.localdate()
    made = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today + timedelta(days=20))
    made.robots.add(robot, other_robot)
    return made


def booked(course, robot, count):
    """Book hours after another, each for another student of the course."""
    Booking.objects.all().delete()
    begin = (timezone.now() + timedelta(days=1)).replace(minute=0, second=0, microsecond=0)
    for hour in range(count):
        person, _new = User.objects.get_or_create(username=f"s{hour}", email=f"s{hour}@example.org")
        Enrolment.objects.get_or_create(course=course, person=person)
        starts, ends = begin + timedelta(hours=hour), begin + timedelta(hours=hour + 1)
        times = {"starts_at": starts, "ends_at": ends, "held_until": ends, "made_at": timezone.now()}
        Booking.objects.create(robot=robot, person=person, course=course, **times)


def test_the_queries_do_not_grow_with_the_bookings(course, robot, staff):
    door = Client()
    door.force_login(staff)
    archive = reverse("course-archive", args=[course.slug])
    counts = []
    for bookings in (4, 4, 12):  # the first round fills caches
        booked(course, robot, bookings)
        Change.objects.all().delete()
        with CaptureQueriesContext(connection) as tried:
            asked = door.post(archive, {"archived": "1"})
        with CaptureQueriesContext(connection) as made:
            confirm(door, asked)
        assert Booking.objects.filter(state=State.CANCELLED).count() == bookings
        with CaptureQueriesContext(connection) as undone:
            door.post(reverse("change-undo", args=[Change.objects.get().pk]))
        assert Booking.objects.filter(state=State.BOOKED).count() == bookings
        counts.append([len(tried), *(sum(not _of_letter(one) for one in each) for each in (made, undone))])
    assert counts[2] == counts[1]
    assert Record.objects.filter(kind="booking.cancel").count() == 20


def test_the_queries_do_not_grow_with_the_robots(course, robot, other_robot, operator):
    now = timezone.now()
    counts = []
    for robots in ([robot], [robot, other_robot]):
        with CaptureQueriesContext(connection) as read:
            wishes_of([Wanted(operator, one, Slot(now, now)) for one in robots], now)
        counts.append(len(read))
    assert counts[0] == counts[1]


def _of_letter(query):
    return "bookings_letter" in query["sql"] or "teleop_pushsubscription" in query["sql"]


def test_a_letter_gets_its_calendar_after_the_commit(course, robot, staff):
    booked(course, robot, 1)
    door = Client()
    door.force_login(staff)
    with CaptureQueriesContext(connection) as made:
        confirm(door, door.post(reverse("course-archive", args=[course.slug]), {"archived": "1"}))
    letter = Notification.objects.get()
    assert (letter.claimed_at, letter.calendar[0]["method"]) == (None, "CANCEL")
    commits = [place for place, one in enumerate(made) if one["sql"].startswith("COMMIT")]
    stored = [place for place, one in enumerate(made) if '"bookings_letter"' in one["sql"]]
    assert any(stored[0] < commit < stored[-1] for commit in commits)


def test_the_rights_of_many_are_those_of_each(
    course, robot, other_robot, operator, supervisor, stranger, staff
):
    now = timezone.now()
    Enrolment.objects.create(course=course, person=stranger)
    course.supervisors.add(supervisor)
    later = Course.objects.create(
        name="Later",
        slug="later",
        starts_on=course.ends_on + timedelta(days=5),
        ends_on=course.ends_on + timedelta(days=9),
    )
    later.robots.add(other_robot)
    Enrolment.objects.create(course=later, person=stranger)
    needed = Qualification.objects.create(name="Induction", slug="induction")
    needed.robots.add(other_robot)
    expires = now + timedelta(days=3)
    QualificationGrant.objects.create(qualification=needed, person=operator, expires_at=expires)
    QualificationGrant.objects.create(qualification=needed, person=stranger)
    RobotRole.objects.update_or_create(user=operator, robot=other_robot, defaults={"role": Role.OPERATOR})
    closed = User.objects.create_user("gone", is_active=False)
    wanted = [
        Wanted(person, one, Slot(starts, starts + timedelta(hours=hours)))
        for person in (operator, supervisor, stranger, staff, closed)
        for one in (robot, other_robot)
        for starts in (now + timedelta(days=days) for days in (0, 2, 4, 20, 22, 26))
        for hours in (1, 30)
    ]
    for one, wish in zip(wanted, wishes_of(wanted, now), strict=True):
        alone = wish_of(robot=one.robot, person=one.person, slot=one.slot, now=now)
        names = ("robot", "slot", "role", "role_until", "missing", "qualified_until")
        assert [getattr(wish, name) for name in names] == [
            getattr(alone, name) if name != "role_until" or alone.role is None else wish.role_until
            for name in names
        ]


def test_what_others_change_meanwhile_is_no_part_of_it(course, robot, operator, stranger, staff):
    if connection.vendor == "sqlite":
        pytest.skip("others wait there until the change is committed")
    booked(course, robot, 1)
    [student] = Enrolment.objects.all()
    RobotRole.objects.all().delete()
    theirs = RobotRole.objects.create(user=stranger, robot=robot, role=Role.OPERATOR)

    def of_others():
        RobotRole.objects.create(user=operator, robot=robot, role=Role.OPERATOR)
        theirs.delete()
        connection.close()

    def take():
        unenrol(course=course, people=[student.person], actor=staff)
        other = Thread(target=of_others)
        other.start()
        other.join()

    made = weigh(take, actor=staff, seen=Seen(None))
    assert [row["table"] for row in made.change.rows] == [Enrolment._meta.label]
    undo(change_id=made.change.pk, actor=staff, now=timezone.now())
    assert Enrolment.objects.filter(pk=student.pk).exists()
    assert list(RobotRole.objects.values_list("user", flat=True)) == [operator.pk]
