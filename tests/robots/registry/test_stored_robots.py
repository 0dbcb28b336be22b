"""All robots, read again only when they change."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from robots.registry.models import Allowance, Robot, RobotProfile
from robots.registry.stored_robots import StoredRobots

pytestmark = pytest.mark.django_db


@pytest.mark.parametrize(
    "change",
    [
        lambda robot: Robot.objects.update(enabled=False),
        lambda robot: RobotProfile.objects.update(blind_mps=0.11),
        lambda robot: Allowance.objects.create(
            robot=robot, what="publish", name="/lamp", type="std_msgs/Bool"
        ),
        lambda robot: robot.delete(),
    ],
    ids=["robot", "profile", "allow-list", "deleted"],
)
def test_robots_are_read_again_after_a_change(robot: Robot, change: Callable[[Robot], object]) -> None:
    stored = StoredRobots()
    assert stored.read()
    change(robot)
    assert stored.read()
    assert [one.enabled for one in stored.robots] == list(Robot.objects.values_list("enabled", flat=True))
    assert not stored.read()


def test_one_query_finds_that_nothing_changed(robot: Robot, other_robot: Robot) -> None:
    stored = StoredRobots()
    stored.read()
    before = stored.robots
    Robot.objects.update(fence=9)  # somebody took control
    with CaptureQueriesContext(
        connection,
    ) as queries:
        assert not stored.read()
    assert len(queries) == 1
    assert stored.robots is before
