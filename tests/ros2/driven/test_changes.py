"""A robot whose software changes under its driver: it drives on, or stands and the page says why."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.probe_findings import BRIDGE, watchdog_name
from tests.ros.bridge_support import Hand, WatchdogProcess
from tests.ros2.side import Side, needs_rclpy
from tests.sides.side import Ros2Side
from tests.sides.turning import stands, turn

pytestmark = needs_rclpy


@pytest.fixture
def laser(side: Ros2Side, fault: Callable[[str], None]) -> Iterator[Side]:
    """A laser in the place of the robot's own."""
    fault("laser_dead")
    laser = Side("tests.ros2.driven.laser_side", side.domain)
    yield laser
    laser.close()


def offer(laser: Side, what: str) -> None:
    laser.say(what)
    laser.await_line(what)


def test_a_laser_may_change_its_qos_during_a_drive(hand: Hand, laser: Side) -> None:
    for what in ("fast", "sure", "kept", "fast"):
        offer(laser, what)
        state = turn(hand, lambda state: all(one.ok for one in state.sensors if one.kind == "scan"))
        assert state.text == ""


def test_a_laser_of_a_newer_version_stops_the_drive_and_is_named(
    hand: Hand,
    laser: Side,
    fault: Callable[[str], None],
) -> None:
    offer(laser, "sure")
    turn(hand)
    offer(laser, "newer")
    assert "laser" in stands(hand, "scan_stale").text
    named = "/scan_raw: sensor_msgs/msg/LaserScan has other fields at /laser than here: its messages are not read."
    hand.state_until(lambda state: state.text == named, "the page to name it")
    laser.close()
    fault("none")
    turn(hand)


def test_nobody_reconfigures_or_ends_bridge_and_watchdog(
    side: Ros2Side,
    watchdog: WatchdogProcess,
    hand: Hand,
    config: BridgeConfig,
) -> None:
    """They serve no parameters, no life cycle, no levels of logs: a stranger asks for each."""
    turn(hand)
    ours = [BRIDGE.strip("/"), watchdog_name(config.robot_id).strip("/")]
    meddler = Side("tests.ros2.hostile.meddler", side.domain, *ours, "play_motion2")
    try:
        for name in ours:
            assert meddler.await_line("serves") == ["serves", name]
        assert "/play_motion2/set_parameters" in meddler.await_line("serves")
        _, *answered = meddler.await_line("answered")
        assert answered and all(service.startswith("/play_motion2/") for service in answered)
    finally:
        meddler.close()
    hand.news()
    turn(hand)
