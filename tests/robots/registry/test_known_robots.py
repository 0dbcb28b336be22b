"""The registry's robots, always with their newest values."""

import pytest

from robots.registry import known_robots
from robots.registry.known_robots import known_robot
from robots.registry.models import Allowance, Robot, RobotProfile

pytestmark = pytest.mark.django_db


def test_models_are_kept_while_nothing_changes(robot, django_assert_num_queries):
    known = known_robot(robot.id)
    with django_assert_num_queries(2):
        assert known_robot(robot.id) is known
    assert known_robot(Robot(slug="none").id) is None


@pytest.mark.parametrize("of", ["robot", "profile"])
def test_each_change_is_seen_also_one_that_the_database_got_directly(of, robot):
    assert known_robot(robot.id).robot.enabled
    Robot.objects.filter(pk=robot.pk).update(enabled=False)
    assert not known_robot(robot.id).robot.enabled
    RobotProfile.objects.filter(pk=robot.profile_id).update(forward_mps=0.5)
    assert known_robot(robot.id).facts.limits.forward_mps == 0.5
    owner = {"robot": robot} if of == "robot" else {"profile": robot.profile}
    before = len(known_robot(robot.id).allowed)
    entry = Allowance.objects.create(what="publish", name="/lamp", type="std_msgs/Bool", **owner)
    assert len(known_robot(robot.id).allowed) == before + 1
    entry.delete()
    assert len(known_robot(robot.id).allowed) == before
    robot.delete()
    assert known_robot(robot.id) is None


def test_a_change_between_the_queries_keeps_nothing(robot, monkeypatch):
    read = known_robots._read

    def changed_after(robot_id):
        monkeypatch.setattr(known_robots, "_read", read)
        before = read(robot_id)
        Robot.objects.filter(pk=robot.pk).update(name="Meanwhile")
        return before

    monkeypatch.setattr(known_robots, "_read", changed_after)
    assert known_robot(robot.id).robot.name == "Meanwhile"
    Robot.objects.filter(pk=robot.pk).update(name=robot.name)
    assert known_robot(robot.id).robot.name == robot.name
