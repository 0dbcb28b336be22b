"""A ROS 2 robot in a namespace, with later software than its profile names: found by type, driven and stopped."""

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from robots.registry.configuration import robot_config
from robots.registry.models import Robot, RobotProfile
from robots.registry.shipped_profiles import profile_files
from robots.shared import wire
from robots.shared.configuration.bridge_config import GRIPPER_COMMAND_2, BridgeConfig
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import watchdog_config
from tests.processes import until
from tests.ros.bridge_support import Hand, drivable, listens, tiago_config
from tests.ros2.side import Side, needs_rclpy
from tests.ros2.test_simulator import CANCELED, Visitor

NAMESPACE = "/tiago1"
OPTIONS = (
    "--ros=2",
    "--later",
    f"--namespace={NAMESPACE}",
    "--pose=2,1.8,0",
    "--drift=0",
    "--exit-with-parent",
)
GOALS = f"{NAMESPACE}/head_controller/point_head_action/_action/status"

pytestmark = needs_rclpy


@pytest.fixture(scope="module", autouse=True)
def robot(domain: int):
    side = Side("robots.simulator", domain, *OPTIONS)
    yield side
    side.close()


@pytest.fixture
def config(domain: int, tmp_path: Path) -> BridgeConfig:
    """The shipped profile's configuration; the gripper has its own controller besides."""
    [file] = [file for file in profile_files() if file.slug == "tiago-ros2"]
    robot = Robot(profile=RobotProfile(**file.columns()), namespace=NAMESPACE)
    known = robot_config.of(robot)
    assert known.topics.gripper is not None
    gripper = msgspec.structs.replace(
        known.topics.gripper,
        action=f"{NAMESPACE}/gripper_controller/gripper_cmd",
        type=GRIPPER_COMMAND_2,
        effort_n=30.0,
    )
    topics = msgspec.structs.replace(known.topics, gripper=gripper)
    nowhere: Any = SimpleNamespace(uri="")
    ros = Ros2(domain, "localhost", namespace=NAMESPACE)
    return tiago_config(nowhere, tmp_path, ros=ros, topics=topics, gate=known.gate)


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


def takes_control(hand: Hand) -> None:
    hand.state_until(drivable, "a robot that can be driven")
    hand.take_control(1)


@pytest.fixture
def visitor(domain: int):
    side = Visitor("tests.ros2.visitor", domain)
    yield side
    side.close()


def test_a_killed_bridge_leaves_a_zero_that_the_robot_takes(
    hand: Hand, bridge: Side, visitor: Visitor
) -> None:
    takes_control(hand)
    topic = f"{NAMESPACE}/key_vel"
    visitor.ask(listen=topic, kind="geometry_msgs/TwistStamped")
    visitor.hear(topic)
    hand.drive_until(0.5, lambda state: state.odometry.vx > 0.1, "motion")
    bridge.process.kill()
    visitor.hear(topic, lambda message: message["twist"]["linear"]["x"] > 0.0)
    visitor.hear(topic, lambda message: message["twist"]["linear"]["x"] == 0.0)


def test_it_speaks_by_the_only_voice_that_it_has(hand: Hand) -> None:
    def has_voice(report: Any) -> bool:
        return isinstance(report, wire.Offers) and report.uses["speech"].topic == f"{NAMESPACE}/say"

    assert hand.until(has_voice, "the robot's voice").uses["speech"].refusal is None
    takes_control(hand)
    assert hand.ask(wire.Say(1, "hello lab", "en-GB", seq=1)) is None
    hand.state_until(lambda state: state.speech_ended and state.speech_ended.outcome == "done", "the end")


def test_head_and_gripper_move_by_their_actions_until_a_stop(hand: Hand, visitor: Visitor) -> None:
    takes_control(hand)
    visitor.ask(listen=GOALS, kind="action_msgs/GoalStatusArray", kept=True)
    assert hand.ask(wire.MoveLimb(1, "gripper", 0.08, 1)) is None
    hand.state_until(
        lambda state: (ended := state.limbs["gripper"].ended) and ended.outcome == "done", "open"
    )
    hand.send(wire.TurnHead(1, 0.3, -0.2, 2, absolute=True))
    hand.state_until(
        lambda state: (ended := state.head_ended) and (ended.seq, ended.outcome) == (2, "done"), "there"
    )
    hand.send(wire.TurnHead(1, -1.2, 0.0, 3, absolute=True))
    assert hand.ask(wire.MoveLimb(1, "gripper", 0.0, 4)) is None
    hand.state_until(lambda state: state.limbs["gripper"].at_m < 0.07, "fingers that move")
    hand.send(wire.LinkStop("ann", "enough"))
    ended = (
        hand.state_until(lambda state: state.limbs["gripper"].to_m is None, "the end").limbs["gripper"].ended
    )
    assert ended is not None and ended.outcome == "stopped"
    visitor.hear(GOALS, lambda told: CANCELED in [goal["status"] for goal in told["status_list"]])
