"""The fleet map lists the robots that a person may see, and no other."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.test import Client

from fleet.accounts.models import User
from robots.registry.models import Robot

pytestmark = pytest.mark.django_db


def test_the_plan_lists_only_robots_that_one_may_see(
    signed_in: Callable[[User], Client],
    observer: User,
    staff: User,
    stranger: User,
    robot: Robot,
    other_robot: Robot,
) -> None:
    for person, listed in ((observer, (True, False)), (staff, (True, True)), (stranger, (False, False))):
        page = signed_in(person).get("/plan/").content.decode()
        assert tuple(one.name in page for one in (robot, other_robot)) == listed
    assert "You may not see any robot" in signed_in(stranger).get("/plan/").content.decode()
    assert Client().get("/plan/").status_code == 401
