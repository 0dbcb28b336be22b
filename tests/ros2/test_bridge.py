"""Bridge and watchdog of a simulated ROS 2 robot: it drives, speaks, moves and navigates until a stop."""

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import (
    BridgeConfig,
    DepthSource,
    LimbSource,
    NavigationSource,
    Topic,
)
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import watchdog_config
from tests.processes import until
from tests.ros.bridge_support import Hand, drivable, listens, tiago_config
from tests.ros.navigation.conftest import FAR, Traveller
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
    options = ("--ros=2", "--name=tiago-9", "--pose=2,1.8,0", "--seed=1", "--drift=0", "--exit-with-parent")
    side = Side("robots.simulator", domain, *options)
    yield side
    side.close()


@pytest.fixture
def config(domain: int, tmp_path: Path) -> BridgeConfig:
    topics: dict[str, Any] = {
        "drive": Topic("/key_vel", "geometry_msgs/msg/Twist"),
        "odometry": Topic("/mobile_base_controller/odom", "nav_msgs/msg/Odometry"),
        "battery": Topic("/power/battery_level", "std_msgs/msg/Float32"),
        "joint_states": Topic("/joint_states", "sensor_msgs/msg/JointState"),
        "depth": DEPTH,
        "speech": Topic("/tts_engine/tts", "tts_msgs/action/TTS"),
        "languages": ["en-GB"],
        "motions": Topic("/play_motion2", "play_motion2_msgs/action/PlayMotion2"),
        "torso": LimbSource(
            "/torso_controller/follow_joint_trajectory",
            ["torso_lift_joint"],
            (0.0, 0.35),
            0.07,
            "control_msgs/action/FollowJointTrajectory",
        ),
        "map": Topic("/map", "nav_msgs/msg/OccupancyGrid"),
        "navigation": NavigationSource(
            "/navigate_to_pose",
            "/cmd_vel",
            "/amcl_pose",
            "nav2_msgs/action/NavigateToPose",
            "/plan",
            "/initialpose",
        ),
        "cancel_on_stop": ["/tts_engine/tts", "/play_motion2"],
    }
    nowhere: Any = SimpleNamespace(uri="")
    gate = {"depth": DepthView(DEPTH.height_m, DEPTH.own_m)}
    return tiago_config(nowhere, tmp_path, ros=Ros2(domain, "localhost"), topics=topics, gate=gate)


@pytest.fixture
def bridge(domain: int, config: BridgeConfig, tmp_path: Path):
    file = tmp_path / "config"
    file.write_bytes(msgspec.json.encode(config))
    watchdog = Side("robots.bridge.watchdog", domain, msgspec.json.encode(watchdog_config(config)).decode())
    bridge = Side("tests.ros.bridge_process", domain, str(file), str(tmp_path / "records"))
    yield bridge
    bridge.close()
    watchdog.close()


@pytest.fixture
def hand(config: BridgeConfig, bridge: Side):
    path = config.link.unix_path
    assert path is not None
    until(lambda: listens(path), "the bridge listens")
    with closing(Hand(path)) as hand:
        yield hand


def test_a_person_drives_it_until_a_stop(hand: Hand) -> None:
    hand.state_until(drivable, "a robot that can be driven")
    hand.take_control(1)
    hand.state_until(lambda state: any(one.ok for one in state.sensors if one.kind == "depth"), "pictures")
    begin = hand.state_until(lambda state: state.odometry is not None, "odometry").odometry
    hand.drive_until(1.0, lambda state: state.odometry.x > begin.x + 0.3, "30 cm")
    pressed_m = hand.state.odometry.x
    hand.send(wire.LinkStop("ann", "enough"))
    stopped = hand.state_until(
        lambda state: state.stop.state != "clear" and state.odometry.vx == 0.0, "a stop"
    )
    assert stopped.odometry.x < pressed_m + 0.7


@pytest.mark.last  # it leaves the robot between tables
def test_it_goes_to_a_place_until_a_stop(hand: Hand) -> None:
    hand.state_until(drivable, "a robot that can be driven")
    hand.take_control(1)
    hand.let_go()
    traveller = Traveller(None, hand)
    begin = hand.state_until(lambda state: state.odometry is not None, "odometry").odometry
    traveller.go(*FAR)
    traveller.until(lambda state: state.going and state.odometry.x > begin.x + 0.3, "a drive by navigation")
    hand.send(wire.LinkStop("ann", "enough"))
    hand.state_until(lambda state: state.going_ended and state.odometry.vx == 0.0, "the end of the drive")
