"""The watchdog of a ROS 2 robot, a process of its own, with no bridge beside it."""

import socket
import uuid
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import WatchdogConfig
from tests.processes import until
from tests.ros2.side import PATIENCE_S, Side, needs_rclpy
from tests.sides.side import Ros2Side
from tests.sides.visitor import Visitor

pytestmark = needs_rclpy


@pytest.fixture
def config(domain: int, tmp_path: Path) -> WatchdogConfig:
    return WatchdogConfig(
        robot_id=uuid.uuid4(),
        slug="tiago",
        ros=Ros2(domain, "localhost"),
        node="/fleet_watchdog_0",
        drive=Topic("/key_vel", "geometry_msgs/msg/Twist"),
        actions=("/nobody", "/play_motion2"),
        lane=str(tmp_path / "lane"),
        state_dir=str(tmp_path),
    )


def test_a_stop_is_confirmed_when_the_robot_gets_it_not_the_tap(
    domain: int, network: Ros2Side, config: WatchdogConfig, tmp_path: Path
) -> None:
    with (
        closing(Visitor(network, tmp_path, "fleet_tap_1")) as tap,
        tap.listen("/key_vel", "geometry_msgs/Twist") as twists,
        closing(Side("robots.bridge.watchdog", domain, msgspec.json.encode(config).decode())),
        socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane,
    ):
        until(lambda: lane.connect_ex(config.lane) == 0, "the watchdog listens")
        lane.send(wire.encode(wire.LinkStop("ann", press=uuid.uuid4())))
        for _ in range(3):
            twists.next()
        lane.setblocking(False)
        with pytest.raises(BlockingIOError):
            lane.recv(1 << 16)
        lane.setblocking(True)
        with closing(Side("tests.ros2.robot_side", domain)) as robot:
            robot.await_line("twist")
            lane.settimeout(PATIENCE_S)
            assert b"stopped" in lane.recv(1 << 16)
            assert robot.await_line("cancel_other") == ["cancel_other", "all"]  # of no configuration
