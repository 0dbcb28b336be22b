"""Two thousand people in a course or a group: pages with a search, and a number of queries that does not grow."""

from __future__ import annotations

from datetime import datetime, time, timedelta
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.base.web.paging import ROWS
from fleet.bookings.free_time import free_on_any
from robots.access.models import Course, Enrolment, GroupRole, RobotGroup
from robots.access.selectors import lab_date
from robots.registry.models import Robot, RobotProfile

PEOPLE = ROWS + 30


@pytest.fixture
def people(db: None) -> list[User]:
    named = (User(username=f"p{n:03}", full_name=f"Person {n:03}") for n in range(PEOPLE))
    return User.objects.bulk_create(named)


@pytest.fixture
def course(people: list[User], robot: Robot) -> Course:
    today = lab_date()
    made = Course.objects.create(
        name="Large", slug="large", starts_on=today, ends_on=today + timedelta(days=1)
    )
    made.robots.add(robot)
    numbered = (Enrolment(course=made, person=one, number=f"n{n:03}") for n, one in enumerate(people))
    Enrolment.objects.bulk_create(numbered)
    return made


@pytest.fixture
def group(people: list[User]) -> RobotGroup:
    made = RobotGroup.objects.create(name="All", slug="all")
    GroupRole.objects.bulk_create(GroupRole(group=made, user=one, role="observer") for one in people)
    return made


@pytest.fixture
def address(request: pytest.FixtureRequest) -> str:
    request.getfixturevalue(request.param[0])
    return request.param[1]


BOTH = [("course", "/courses/large/"), ("group", "/robot-groups/all/people/")]


@pytest.mark.parametrize("address", BOTH, indirect=True)
def test_people_come_in_pages_and_are_found(
    client: Client, staff: User, address: str, django_assert_max_num_queries: Any
) -> None:
    client.force_login(staff)

    def shown(query: str) -> list[bool]:
        page = client.get(address + query).content.decode()
        return [f"Person {n:03}" in page for n in (0, ROWS - 1, ROWS, PEOPLE - 1)]

    with django_assert_max_num_queries(20):
        assert shown("") == [True, True, False, False]
    assert shown("?page=2") == [False, False, True, True]
    assert shown("?page=999") == shown("?page=2")
    assert shown(f"?q=person+{PEOPLE - 1}") == [False, False, False, True]
    assert "Nobody is found." in client.get(f"{address}?q=zanzibar").content.decode()


@pytest.mark.parametrize(
    ("address", "door", "sent"),
    [
        (*BOTH[:1], "/courses/large/people/", {"action": "invite_again"}),
        (
            *BOTH[1:],
            "/robot-groups/",
            {"entry": "all", "action": "role", "username": "p101", "role": "operator"},
        ),
    ],
    indirect=["address"],
)
def test_a_form_leads_back_to_its_page_of_the_list(
    client: Client, staff: User, address: str, door: str, sent: dict[str, str]
) -> None:
    client.force_login(staff)
    place = "page=2&q=person"
    assert 'name="list" value="page=2&amp;q=person"' in client.get(f"{address}?{place}").content.decode()
    done = client.post(f"{door}?confirm=yes", {**sent, "list": f"{place}&next=//evil.example"})
    assert done["Location"] == f"{address}?{place}#list"
    assert client.post(f"{door}?confirm=yes", sent)["Location"] == address


def test_everybody_means_all_pages_of_a_course(client: Client, staff: User, course: Course) -> None:
    client.force_login(staff)
    page = client.get("/courses/large/").content.decode()
    assert f"{PEOPLE} people" in page
    client.post("/courses/large/people/?confirm=yes", {"action": "unenrol", "everybody": "on"})
    assert not course.enrolments.exists()


@pytest.mark.parametrize("clock", ["12:00", "23:45"])  # a slot over midnight has roles of two days
def test_the_next_free_hour_of_many_robots_costs_no_more_queries(
    tiago: RobotProfile, course: Course, people: list[User], django_assert_max_num_queries: Any, clock: str
) -> None:
    robots = [
        Robot.objects.create(slug=f"r{n}", name=f"R {n}", profile=tiago, master_uri="http://127.0.0.1:9")
        for n in range(20)
    ]
    course.robots.set(robots)
    now = datetime.combine(lab_date(), time.fromisoformat(clock), timezone.get_default_timezone())
    with django_assert_max_num_queries(15):
        found = free_on_any(robots, people[0], 30, after=now, now=now, most=1)
    assert found and found[0][1].starts_at - now < timedelta(hours=1)
