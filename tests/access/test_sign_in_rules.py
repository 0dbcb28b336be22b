"""Rules of single sign-on: they give and take what the claims say, and leave alone what people gave."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

import pytest
from django.test import Client

from fleet.accounts.models import User
from robots.access.models import Course, Enrolment, GroupRole, RobotGroup, SignInRule
from robots.access.sign_in_rules.claims import values_of
from robots.access.sign_in_rules.rules import apply
from robots.registry.models import Robot


@pytest.mark.parametrize(
    ("claims", "name", "values"),
    [
        ({"groups": ["a", "b"]}, "groups", {"a", "b"}),
        ({"groups": "a"}, "groups", {"a"}),
        ({"realm_access": {"roles": ["x"]}}, "realm_access.roles", {"x"}),
        ({"https://lab.example/groups": ["x"]}, "https://lab.example/groups", {"x"}),
        ({"member": True, "year": 2026}, "member", {"true"}),
        ({"groups": [{"id": 1}, None, "a"]}, "groups", {"a"}),
        ({"groups": None}, "groups", set()),
        ({"groups": ["a"]}, "groups.a", set()),
        ({}, "groups", set()),
    ],
)
def test_values_of_claims(claims: dict[str, object], name: str, values: set[str]) -> None:
    assert values_of(claims, name) == values


@pytest.fixture
def course(robot: Robot) -> Course:
    made = Course.objects.create(name="HRI", slug="hri", starts_on=date(2026, 1, 1), ends_on=date(2099, 1, 1))
    made.robots.add(robot)
    return made


@pytest.mark.django_db
def test_rules_take_only_what_rules_gave(course: Course, robot: Robot, operator: User) -> None:
    group = RobotGroup.objects.create(name="All", slug="all")
    by_hand = Course.objects.create(
        name="Lab", slug="lab", starts_on=course.starts_on, ends_on=course.ends_on
    )
    Enrolment.objects.create(course=by_hand, person=operator)
    for facts in (
        {"value": "students", "course": course},
        {"value": "students", "course": by_hand},
        {"value": "students", "group": group, "role": "observer"},
        {"value": "tutors", "group": group, "role": "operator"},
    ):
        SignInRule.objects.create(claim="groups", **facts)

    def held() -> tuple[set[str], list[str]]:
        courses = Enrolment.objects.filter(person=operator).values_list("course__slug", flat=True)
        return set(courses), list(GroupRole.objects.filter(user=operator).values_list("role", flat=True))

    apply(operator, {"groups": ["students"]})
    assert held() == ({"hri", "lab"}, ["observer"])
    apply(operator, {"groups": ["students", "tutors"]})
    assert held() == ({"hri", "lab"}, ["operator"])
    apply(operator, {"groups": ["students"]})
    assert held() == ({"hri", "lab"}, ["observer"])
    apply(operator, {})
    assert held() == ({"lab"}, [])
    GroupRole.objects.create(group=group, user=operator, role="supervisor")
    apply(operator, {"groups": ["tutors"]})
    apply(operator, {})
    assert held() == ({"lab"}, ["supervisor"])


@pytest.mark.django_db
def test_the_page_makes_and_removes_rules(
    course: Course, staff: User, operator: User, signed_in: Callable[[User], Client]
) -> None:
    group = RobotGroup.objects.create(name="All", slug="all")
    page = signed_in(staff)
    wrong = page.post("/sign-in-rules/", {"claim": "groups", "value": "a"})
    assert (wrong.status_code, "one of the two" in wrong.content.decode()) == (400, True)
    wrong = page.post("/sign-in-rules/", {"claim": "groups", "value": "a", "group": group.pk})
    assert "Choose a role" in wrong.content.decode()
    rule = {"claim": "groups", "value": "a", "course": course.pk}
    assert page.post("/sign-in-rules/", rule).status_code == 302
    assert "There is such a rule already" in page.post("/sign-in-rules/", rule).content.decode()
    apply(operator, {"groups": "a"})
    assert page.post("/sign-in-rules/", {"remove": SignInRule.objects.get().pk}).status_code == 302
    apply(operator, {})
    assert Enrolment.objects.filter(person=operator, course=course).exists()
    assert signed_in(operator).get("/sign-in-rules/").status_code == 403
