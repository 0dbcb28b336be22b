"""The check of a robot's set-up: what it finds on the simulated robot, and on one with many faults."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import pytest

from robots.registry.models import Robot, RobotProfile
from tests.check_robot import check
from tests.processes import end
from tests.sides.side import Side
from tests.sides.visitor import Visitor

pytestmark = pytest.mark.django_db
ODOMETRY, SCANS, SONARS, DRIVE = "/mobile_base_controller/odom", "/scan_raw", "/sonar_base", "/key_vel"
HOUR_S = 3600.0


@pytest.fixture
def registered(db: None, side: Side) -> Robot:
    profile = RobotProfile.objects.get(slug=side.profile)
    return Robot.objects.create(slug="second", name="Second", profile=profile, **side.address())


def test_the_simulated_tiago_is_ready_to_be_driven(registered: Robot, simulator: Callable[..., Any]) -> None:
    running = simulator(world="office")
    answers = check(registered)
    end(running)
    assert {name: answer["text"] for name, answer in answers.items() if answer["level"] != "ok"} == {}
    assert "/simulator" in answers["drive"]["text"]


def test_all_faults_are_named_at_once(side: Side, registered: Robot, visitor: Visitor) -> None:
    with ExitStack() as robot:

        def speaks(topic: str, kind: str) -> Any:
            return robot.enter_context(visitor.speak(topic, kind, listeners=0))

        ahead = {"header": {"frame_id": "odom", "stamp": time.time() + HOUR_S}, "child_frame_id": "base"}
        speaks(ODOMETRY, "nav_msgs/Odometry").repeat(20.0, **ahead)
        speaks(SCANS, "std_msgs/String")
        speaks(SONARS, "sensor_msgs/Range")  # and says nothing
        speaks(DRIVE, "geometry_msgs/Twist")
        speaks("/clock", "rosgraph_msgs/Clock")  # of a stranger: the robot's nodes do not follow it
        answers = check(registered)
        node = "" if side.number == 1 else visitor.name
        visitor.set_parameter(node, "use_sim_time", True)
        simulated = check(registered)["clock"]["text"]
        visitor.set_parameter(node, "use_sim_time", False)
    assert simulated == "The robot’s clock is simulated (use_sim_time): ages are not compared."
    found = {name: (answer["level"], answer["text"]) for name, answer in answers.items()}
    assert found["odometry"][0] == "ok"
    assert found["clock"][0] == "warn" and "s ahead of the console’s clock" in found["clock"][1]
    string, scan = side.type("std_msgs/String"), side.type("sensor_msgs/LaserScan")
    assert found[f"scan {SCANS}"] == ("fail", f"{SCANS} is a {string}, not a {scan}.")
    assert "exists, but no message came" in found[f"sonars {SONARS}"][1]
    assert "No node publishes" in found["joint states"][1]
    assert found["other drivers"][0] == "warn" and visitor.name in found["other drivers"][1]
    assert f"No node listens to {DRIVE}" in found["drive"][1]
