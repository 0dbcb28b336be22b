"""Rights of each role on a robot."""

from __future__ import annotations

import pytest

from fleet.accounts.models import User
from robots.registry.models import Robot, Role
from robots.registry.selectors import robots_visible_to, role_on


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
