"""Rights of each role on a robot."""

from __future__ import annotations

from datetime import date, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from django.test import Client
from django.utils import timezone
from pytest_django import DjangoAssertNumQueries

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant, RobotGroup
from robots.access.selectors import (
    manages_robot,
    missing_qualifications,
    reasons,
    robots_of,
    robots_visible_to,
    role_on,
    roles_of,
    roles_on,
)
from robots.access.services import role_set
from robots.registry.models import Robot, RobotRole, Role


def test_roles_are_ordered_each_including_those_below() -> None:
    assert sorted([Role.STAFF, Role.OPERATOR, Role.OBSERVER, Role.SUPERVISOR]) == list(Role)
    assert Role.SUPERVISOR > Role.OPERATOR >= Role.OPERATOR > Role.OBSERVER
    assert not Role.SUPERVISOR > Role.STAFF
    assert Role.OBSERVER <= Role.OPERATOR < Role.STAFF


@pytest.mark.parametrize("name", ["observer", "operator", "supervisor"])
def test_a_role_counts_on_its_robot_only(
    name: str, robot: Robot, other_robot: Robot, request: pytest.FixtureRequest
) -> None:
    person = request.getfixturevalue(name)
    assert role_on(person, robot) == Role(name)
    assert role_on(person, other_robot) is None
    assert list(robots_visible_to(person)) == [robot]


def test_staff_is_staff_on_every_robot(staff: User, robot: Robot, other_robot: Robot) -> None:
    assert role_on(staff, robot) is role_on(staff, other_robot) is Role.STAFF
    assert list(robots_visible_to(staff)) == [robot, other_robot]


def test_a_stranger_sees_nothing(stranger: User, robot: Robot) -> None:
    assert role_on(stranger, robot) is None
    assert not robots_visible_to(stranger).exists()


@pytest.mark.parametrize("name", ["operator", "staff"])
def test_a_closed_account_has_no_role(name: str, robot: Robot, request: pytest.FixtureRequest) -> None:
    person = request.getfixturevalue(name)
    person.is_active = False
    assert role_on(person, robot) is None
    assert not robots_visible_to(person).exists()


# --- courses --------------------------------------------------------------------------------------


def test_a_course_gives_its_role_on_its_robots_only(
    course: Course, student: User, teacher: User, robot: Robot, other_robot: Robot
) -> None:
    assert role_on(student, robot) is Role.OPERATOR
    assert role_on(teacher, robot) is Role.SUPERVISOR
    assert roles_on(robot.id, [student, teacher]) == {student.id: Role.OPERATOR, teacher.id: Role.SUPERVISOR}
    for person in (student, teacher):
        assert role_on(person, other_robot) is None
        assert list(robots_visible_to(person)) == [robot]


def test_a_group_stands_for_its_robots(course: Course, student: User, other_robot: Robot) -> None:
    group = RobotGroup.objects.create(name="The others", slug="others")
    course.groups.add(group)
    assert role_on(student, other_robot) is None
    group.robots.add(other_robot)
    assert role_on(student, other_robot) is Role.OPERATOR
    assert len(robots_visible_to(student)) == len(robots_of(course)) == 2


@pytest.mark.parametrize(
    ("own", "highest"), [(Role.OBSERVER, Role.OPERATOR), (Role.SUPERVISOR, Role.SUPERVISOR)]
)
def test_the_highest_role_counts(
    own: Role, highest: Role, course: Course, student: User, robot: Robot, staff: User
) -> None:
    role_set(robot=robot, user=student, role=own, actor=staff)
    assert role_on(student, robot) is highest
    assert roles_on(robot.id, [student]) == {student.id: highest}


@pytest.mark.parametrize("zone", ["Pacific/Kiritimati", "Pacific/Pago_Pago"])
def test_both_days_of_a_course_count_in_the_labs_zone(
    zone: str, course: Course, student: User, robot: Robot, settings: Any
) -> None:
    settings.TIME_ZONE = zone
    Course.objects.update(starts_on=date(2026, 3, 28), ends_on=date(2026, 3, 30))
    lab = ZoneInfo(zone)
    inside = [datetime(2026, 3, 28, tzinfo=lab), datetime(2026, 3, 30, 23, 59, tzinfo=lab)]
    outside = [datetime(2026, 3, 27, 23, 59, tzinfo=lab), datetime(2026, 3, 31, tzinfo=lab)]
    assert [role_on(student, robot, at) for at in inside] == [Role.OPERATOR, Role.OPERATOR]
    assert [role_on(student, robot, at) for at in outside] == [None, None]


def test_an_archived_course_gives_nothing(course: Course, student: User, teacher: User, robot: Robot) -> None:
    Course.objects.update(archived=True)
    assert role_on(student, robot) is role_on(teacher, robot) is None
    assert not robots_visible_to(student)


def test_roles_of_any_number_of_people_take_one_query(
    course: Course, robot: Robot, other_robot: Robot, django_assert_num_queries: DjangoAssertNumQueries
) -> None:
    people = [User.objects.create_user(f"p{number}") for number in range(20)]
    for number in range(5):
        another = Course.objects.create(
            name=f"C{number}", slug=f"c{number}", starts_on=course.starts_on, ends_on=course.ends_on
        )
        another.robots.add(robot, other_robot)
        Enrolment.objects.bulk_create(Enrolment(course=another, person=person) for person in people)
    with django_assert_num_queries(1):
        assert len(roles_on(robot.id, people)) == 20
    with django_assert_num_queries(1):
        assert len(roles_of(people[0], [robot, other_robot])) == 2


def test_reasons_name_every_source_the_highest_first(
    course: Course, student: User, robot: Robot, staff: User
) -> None:
    role_set(robot=robot, user=student, role=Role.OBSERVER, actor=staff)
    [reason] = reasons(student, timezone.now())
    assert (reason.robot, reason.role) == (robot, Role.OPERATOR)
    assert [(source.role, source.course) for source in reason.sources] == [
        (Role.OPERATOR, course),
        (Role.OBSERVER, None),
    ]


def test_roles_given_changed_and_taken_are_recorded(robot: Robot, stranger: User, staff: User) -> None:
    for role in (Role.OBSERVER, Role.SUPERVISOR, Role.SUPERVISOR, None, None):
        role_set(robot=robot, user=stranger, role=role, actor=staff)
    changes = Record.objects.filter(kind="role.change").order_by("id")
    assert [(change.parameters["from"], change.parameters["to"]) for change in changes] == [
        (None, "observer"),
        ("observer", "supervisor"),
        ("supervisor", None),
    ]
    assert not RobotRole.objects.filter(user=stranger).exists()


# --- qualifications -------------------------------------------------------------------------------


def test_a_qualification_is_demanded_by_robot_or_group(student: User, robot: Robot, staff: User) -> None:
    group = RobotGroup.objects.create(name="TIAGos", slug="tiagos")
    group.robots.add(robot)
    induction = Qualification.objects.create(name="safety induction", slug="induction")
    now = timezone.now()
    assert missing_qualifications(student, robot, now) == []
    induction.groups.add(group)
    induction.robots.add(robot)
    assert missing_qualifications(student, robot, now) == [induction]
    assert missing_qualifications(staff, robot, now) == []
    QualificationGrant.objects.create(
        qualification=induction, person=student, expires_at=now + timedelta(hours=1)
    )
    assert missing_qualifications(student, robot, now) == []
    assert missing_qualifications(student, robot, now + timedelta(hours=1)) == [induction]


def test_a_role_on_a_group_counts_on_each_of_its_robots(
    robot: Robot, other_robot: Robot, student: User, staff: User, client: Client
) -> None:
    group = RobotGroup.objects.create(name="the TIAGos", slug="tiagos")
    group.robots.add(robot)
    client.force_login(staff)
    give = {"entry": "tiagos", "action": "role", "username": student.username}
    client.post("/robot-groups/", {**give, "role": "supervisor"})
    assert (role_on(student, robot), role_on(student, other_robot)) == (Role.SUPERVISOR, None)
    assert manages_robot(student, robot) and not manages_robot(student, other_robot)
    group.robots.add(other_robot)
    assert role_on(student, other_robot) is Role.SUPERVISOR
    assert student.display_name in client.get("/robot-groups/tiagos/people/").content.decode()
    client.post("/robot-groups/", give)
    assert role_on(student, robot) is None
    changes = Record.objects.filter(kind="role.change").order_by("pk").values_list("parameters", flat=True)
    assert [(one["group"], one["to"]) for one in changes] == [("tiagos", "supervisor"), ("tiagos", None)]
    for wrong, said in (({"username": "nobody"}, "no open account"), ({"role": "staff"}, "no such role")):
        assert said in client.post("/robot-groups/", {**give, **wrong}, follow=True).content.decode()
    assert role_on(student, robot) is None
