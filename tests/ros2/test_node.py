"""The bridge’s rclpy node against a robot’s base, each in a process and both in a domain of their own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros2.conftest import free_domain
from tests.ros2.side import Side, needs_rclpy

RUN = 7  # place of the run in a line about odometry

pytestmark = needs_rclpy


@pytest.fixture
def domain() -> Iterator[int]:
    """A domain for each test: a killed process stays in its domain for 20 s."""
    with free_domain() as found:
        yield found


@pytest.fixture
def robot(domain: int):
    side = Side("tests.ros2.robot_side", domain)
    yield side
    side.close()


@pytest.fixture
def bridge(domain: int, robot: Side, tmp_path: Path):
    side = Side("tests.ros2.bridge_side", domain, str(domain), str(tmp_path))
    yield side
    side.close()


def test_core_gets_odometry_and_scans(bridge: Side) -> None:
    assert bridge.await_line("odometry")[1:] == ["1.5", "0.0", "0.0", "0.25", "0.0", "-0.5", "1", "True"]
    assert bridge.await_line("scan")[1:] == ["/scan_raw", "1.0", "2.0", "inf", "4.0", "5.0", "-1.0", "10.0"]
    assert bridge.await_line("range") == ["range", "sonar_1", "0.75"]
    assert bridge.await_line("battery") == ["battery", "62.5"]
    assert bridge.await_line("described") == ["described", "8"]
    bridge.await_line("diagnostics", lambda words: words[1:] == ["motor", "1", "/base"])
    bridge.say("joints")
    assert bridge.await_line("joints") == ["joints", "0.5", "-0.25", "None"]


def test_twists_and_cancels_reach_the_robot(bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    bridge.say("0.5 -0.25")
    assert robot.await_line("twist") == ["twist", "0.5", "-0.25"]
    bridge.say("cancel")
    assert robot.await_line("cancel") == ["cancel", "all"]


def test_goals_of_actions_that_nobody_named_are_cancelled_too(bridge: Side, robot: Side) -> None:
    robot.await_line("found")
    bridge.say("cancel")
    assert robot.await_line("cancel_other") == ["cancel_other", "all"]


def test_a_bridge_that_ends_leaves_zero(bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    bridge.say("0.5 0.0")
    robot.await_line("twist")
    bridge.close()
    assert robot.await_line("twist") == ["twist", "0.0", "0.0"]
    assert bridge.await_line("left") == ["left", "True"]


def test_another_run_of_the_robot_is_another_run(domain: int, bridge: Side, robot: Side) -> None:
    before = bridge.await_line("odometry")[RUN]
    bridge.await_line("described")  # the first survey is over
    robot.close(kill=True)
    again = Side("tests.ros2.robot_side", domain)
    try:
        bridge.await_line("odometry", lambda words: words[RUN] != before)
        bridge.await_line("restarted")
    finally:
        again.close()


def test_only_one_bridge_drives_a_robot(domain: int, bridge: Side, robot: Side, tmp_path: Path) -> None:
    """The other one is of a copy of the console: it has the same names for all."""
    bridge.await_line("listened")
    second = Side("tests.ros2.bridge_side", domain, str(domain), str(tmp_path))
    try:
        assert "drives this robot" in " ".join(
            second.await_line("status", lambda words: words[1] == "refused")
        )
        bridge.close(kill=True)
        second.await_line("listened")
    finally:
        second.close()


def test_a_page_reads_whether_the_robot_is_there(bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    bridge.await_line("status", lambda words: words[1] == "connecting")
    robot.close()
    assert "Nothing" in bridge.await_line("status", lambda words: words[1] == "waiting")


def test_a_page_reads_who_else_drives_and_who_hears_nothing(domain: int, bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    visitor = Side("tests.ros2.visitor", domain)
    try:
        visitor.say('{"publish": "/key_vel", "kind": "geometry_msgs/Twist", "fields": {}}')
        visitor.say('{"listen": "/key_vel", "kind": "geometry_msgs/Twist", "kept": true}')
        status = bridge.await_line("status", lambda words: "/visitor" in words and "transient" in words)
        # no text; who else publishes; what does not fit
        assert status[2:6] == ["|", "|", "/visitor", "|"]
        assert status[6:11] == ["/visitor", "gets", "nothing", "on", "/key_vel:"]
    finally:
        visitor.close()
