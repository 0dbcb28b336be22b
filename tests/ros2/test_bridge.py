"""A whole bridge of a simulated ROS 2 robot: joined, driven, held by the gate, stopped."""

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import DepthSource, Topic
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.configuration.robot_ros import Ros2
from tests.processes import until
from tests.ros.bridge_support import Hand, drivable, tiago_config
from tests.ros2.side import Side, needs_rclpy

DEPTH = DepthSource(
    "/xtion/depth_registered/image_raw",
    "sensor_msgs/msg/Image",
    info="/xtion/depth_registered/camera_info",
    fov=1.0996,
    height_m=1.1,
)

pytestmark = needs_rclpy


@pytest.fixture(scope="module", autouse=True)
def robot(domain: int):
    # 2 m in front of it is a wall
    options = ("--ros=2", "--name=tiago-9", "--pose=2,1.8,0", "--seed=1", "--drift=0", "--exit-with-parent")
    side = Side("robots.simulator", domain, *options)
    yield side
    side.close()


@pytest.fixture
def hand(domain: int, tmp_path: Path):
    topics: dict[str, Any] = {
        "drive": Topic("/key_vel", "geometry_msgs/msg/Twist"),
        "odometry": Topic("/mobile_base_controller/odom", "nav_msgs/msg/Odometry"),
        "battery": Topic("/power/battery_level", "std_msgs/msg/Float32"),
        "joint_states": Topic("/joint_states", "sensor_msgs/msg/JointState"),
        "depth": DEPTH,
        "cancel_on_stop": ["/tts_engine/tts", "/play_motion2"],
    }
    nowhere: Any = SimpleNamespace(uri="")
    gate = {"depth": DepthView(DEPTH.height_m, DEPTH.own_m)}
    config = tiago_config(nowhere, tmp_path, ros=Ros2(domain, "localhost"), topics=topics, gate=gate)
    file = tmp_path / "config"
    file.write_bytes(msgspec.json.encode(config))
    bridge = Side("tests.ros.bridge_process", domain, str(file), str(tmp_path / "records"))
    assert config.link.unix_path is not None
    until(Path(config.link.unix_path).exists, "the bridge listens")
    with closing(Hand(config.link.unix_path)) as hand:
        yield hand
    bridge.close()


def test_a_person_drives_it_until_the_gate_or_a_stop_holds_it(hand: Hand) -> None:
    hand.state_until(drivable, "a robot that can be driven")
    hand.take_control(1)
    hand.state_until(lambda state: any(one.ok for one in state.sensors if one.kind == "depth"), "pictures")
    begin = hand.state_until(lambda state: state.odometry is not None, "odometry").odometry
    hand.drive_until(1.0, lambda state: state.odometry.x > begin.x + 0.3, "30 cm")
    hand.send(wire.LinkStop("ann", "enough"))
    stopped = hand.state_until(
        lambda state: state.stop.state != "clear" and state.odometry.vx == 0.0, "a stop"
    )
    assert stopped.odometry.x < begin.x + 1.0
