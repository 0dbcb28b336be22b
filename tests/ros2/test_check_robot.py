"""The check of a robot with ROS 2, by its command: what it finds on the simulated robot, and what it says of faults."""

import json
from io import StringIO
from typing import Any

import pytest
from django.core.management import call_command

from robots.registry.models import Robot, RobotProfile
from tests.ros2.side import Side, needs_rclpy

pytestmark = [needs_rclpy, pytest.mark.django_db]


@pytest.fixture
def check(db: None, domain: int):
    """`check(**changes)`: run the command for a robot; return its answers by name."""
    profile = RobotProfile.objects.get(slug="tiago-ros2")
    robot = Robot.objects.create(
        slug="second", name="Second", profile=profile, domain_id=domain, discovery="localhost"
    )

    def run(**changes: Any) -> dict[str, dict[str, str]]:
        Robot.objects.filter(pk=robot.pk).update(**changes)
        out = StringIO()
        try:
            call_command("check_robot", robot.slug, "--json", stdout=out)
            failed = False
        except SystemExit as ended:
            failed = ended.code == 1
        answers = {answer["name"]: answer for answer in json.loads(out.getvalue())}
        assert failed == any(answer["level"] == "fail" for answer in answers.values())
        return answers

    return run


@pytest.fixture
def simulated(domain: int):
    options = ("--ros=2", "--name=tiago-9", "--pose=2,1.8,0", "--seed=1", "--exit-with-parent")
    side = Side("robots.simulator", domain, *options)
    yield side
    side.close()


def test_the_simulated_tiago_is_ready_to_be_driven(check, simulated) -> None:
    answers = check()
    assert {name: answer["text"] for name, answer in answers.items() if answer["level"] != "ok"} == {}
    assert "/simulator" in answers["drive"]["text"]


def test_a_robot_in_another_domain_is_named_there(check, simulated, domain: int, monkeypatch) -> None:
    """`OTHER_DOMAINS` of the probe are 0 to 9: the fixture's domain is rarely one of them."""
    answers = check(domain_id=domain % 100 + 1)
    assert list(answers) == ["domain"]
    assert f"No node answers in domain {domain % 100 + 1}." in answers["domain"]["text"]
    assert "The search stays on this computer." in answers["domain"]["text"]
    assert f"ROS_DOMAIN_ID should be {domain % 100 + 1}" in answers["domain"]["advice"]
