"""The bridge’s rclpy node against a robot’s base, each in a process."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.ros2.side import Side, needs_rclpy
from tests.sides.visitor import Visitor

pytestmark = needs_rclpy


@pytest.fixture
def robot(domain: int) -> Iterator[Side]:
    with closing(Side("tests.ros2.robot_side", domain)) as robot:
        yield robot


@pytest.fixture
def bridge(domain: int, robot: Side, tmp_path: Path) -> Iterator[Side]:
    with closing(Side("tests.ros2.bridge_side", domain, str(domain), str(tmp_path))) as bridge:
        yield bridge


def test_core_gets_odometry_and_scans(bridge: Side) -> None:
    assert bridge.await_line("odometry")[1:] == ["1.5", "0.0", "0.0", "0.25", "0.0", "-0.5", "1", "True"]
    assert bridge.await_line("scan")[1:] == ["/scan_raw", "1.0", "2.0", "inf", "4.0", "5.0", "-1.0", "10.0"]
    assert bridge.await_line("range") == ["range", "sonar_1", "0.75"]
    assert bridge.await_line("battery") == ["battery", "62.5"]
    assert bridge.await_line("described") == ["described", "8"]
    bridge.await_line("diagnostics", lambda words: words[1:] == ["motor", "1", "/base"])
    bridge.say("joints")
    assert bridge.await_line("joints") == ["joints", "0.5", "-0.25", "None"]


def test_goals_of_actions_that_nobody_named_are_cancelled_too(bridge: Side, robot: Side) -> None:
    robot.await_line("found")
    bridge.say("cancel")
    assert robot.await_line("cancel_other") == ["cancel_other", "all"]


def test_a_page_reads_who_else_drives_and_who_hears_nothing(bridge: Side, visitor: Visitor) -> None:
    bridge.await_line("listened")
    with (
        visitor.speak("/key_vel", "geometry_msgs/Twist"),
        visitor.listen("/key_vel", "geometry_msgs/Twist", kept=True),
    ):
        status = bridge.await_line("status", lambda words: "/visitor" in words and "transient" in words)
    # no text; who else publishes; what does not fit
    assert status[2:6] == ["|", "|", "/visitor", "|"]
    assert status[6:11] == ["/visitor", "gets", "nothing", "on", "/key_vel:"]
