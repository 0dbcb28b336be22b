"""A ROS 2 robot in a namespace, with later software than its profile names: found by type, driven and stopped."""

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robots.registry.configuration import robot_config
from robots.registry.models import Robot, RobotProfile
from robots.registry.shipped_profiles import profile_files
from robots.shared import wire
from robots.shared.configuration.bridge_config import GRIPPER_COMMAND_2, BridgeConfig
from robots.shared.configuration.robot_ros import Ros2
from tests.ros import bridge_support
from tests.ros.bridge_support import BridgeProcess, Hand, drivable, guarded_bridge
from tests.ros2.side import Side, needs_rclpy
from tests.sides.side import Ros2Side
from tests.sides.turning import turn
from tests.sides.visitor import Visitor

NAMESPACE = "/tiago1"
OPTIONS = (
    "--ros=2",
    "--later",
    f"--namespace={NAMESPACE}",
    "--pose=2,1.8,0",
    "--drift=0",
    "--exit-with-parent",
)
CANCELED = 5
VELOCITIES = f"{NAMESPACE}/key_vel", "geometry_msgs/TwistStamped"
NEAR_S = 5.0  # on a busy computer
AHEAD_S = 0.3  # a controller refuses stamps of a clock that is so much behind its own
GOALS = f"{NAMESPACE}/head_controller/point_head_action/_action/status"

pytestmark = needs_rclpy


@pytest.fixture(scope="module")
def robot(domain: int):
    with closing(Side("robots.simulator", domain, *OPTIONS)) as robot:
        yield robot


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
    ros = Ros2(domain, "localhost", namespace=NAMESPACE)
    return bridge_support.robot_config(tmp_path, ros, topics=topics, gate=known.gate)


@pytest.fixture
def bridge(network: Ros2Side, robot: Side, config: BridgeConfig, tmp_path: Path):
    with guarded_bridge(config, network, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield process, hand


@pytest.fixture
def hand(bridge: tuple[BridgeProcess, Hand]) -> Hand:
    return bridge[1]


def test_a_killed_bridge_leaves_a_zero_that_the_robot_takes(
    bridge: tuple[BridgeProcess, Hand], visitor: Visitor
) -> None:
    process, hand = bridge
    hand.take_control(1)
    with visitor.listen(*VELOCITIES) as twists:
        twists.next()
        hand.drive_until(0.5, lambda state: state.odometry.vx > 0.1, "motion")
        process.kill()
        twists.until(lambda message: message.twist.linear.x > 0.0)
        for has in (_zero_stamp, _stamp_of_now):  # the robot takes one of them by any clock
            twists.until(lambda message, has=has: message.twist.linear.x == 0.0 and has(message))


def test_velocities_have_our_stamp_only_while_the_clocks_agree(hand: Hand, visitor: Visitor) -> None:
    hand.take_control(1)
    with (
        visitor.listen(*VELOCITIES) as twists,
        visitor.speak(f"{NAMESPACE}/ground_truth/fault", "std_msgs/String") as fault,
    ):

        def turns_with(has: Callable[[Any], bool]) -> None:
            """Turn until all velocities have this stamp since the last look."""

            def all_have(_: wire.State) -> bool:
                turning = [message for message in twists.drain() if message.twist.angular.z > 0.0]
                return bool(turning) and all(map(has, turning))

            turn(hand, all_have)

        turns_with(_stamp_of_now)
        fault.publish(data=f"clock_ahead_s={AHEAD_S}")
        turns_with(_zero_stamp)
        fault.publish(data="none")
        turns_with(_stamp_of_now)


def _zero_stamp(message: Any) -> bool:
    return bool(message.header.stamp == 0.0)


def _stamp_of_now(message: Any) -> bool:
    return abs(message.header.stamp - time.time()) < NEAR_S


def test_it_speaks_by_the_only_voice_that_it_has(hand: Hand) -> None:
    def has_voice(report: Any) -> bool:
        return isinstance(report, wire.Offers) and report.uses["speech"].topic == f"{NAMESPACE}/say"

    assert hand.until(has_voice, "the robot's voice").uses["speech"].refusal is None
    hand.take_control(1)
    assert hand.ask(wire.Say(1, "hello lab", "en-GB", seq=1)) is None
    hand.state_until(lambda state: state.speech_ended and state.speech_ended.outcome == "done", "the end")


def test_head_and_gripper_move_by_their_actions_until_a_stop(hand: Hand, visitor: Visitor) -> None:
    hand.take_control(1)
    assert hand.ask(wire.MoveLimb(1, "gripper", 0.08, 1)) is None
    hand.state_until(
        lambda state: (ended := state.limbs["gripper"].ended) and ended.outcome == "done", "open"
    )
    hand.send(wire.TurnHead(1, 0.3, -0.2, 2, absolute=True))
    hand.state_until(
        lambda state: (ended := state.head_ended) and (ended.seq, ended.outcome) == (2, "done"), "there"
    )
    with visitor.listen(GOALS, "action_msgs/GoalStatusArray", kept=True) as goals:
        hand.send(wire.TurnHead(1, -1.2, 0.0, 3, absolute=True))
        assert hand.ask(wire.MoveLimb(1, "gripper", 0.0, 4)) is None
        hand.state_until(lambda state: state.limbs["gripper"].at_m < 0.07, "fingers that move")
        hand.send(wire.LinkStop("ann", "enough"))
        state = hand.state_until(lambda state: state.limbs["gripper"].to_m is None, "the end")
        assert state.limbs["gripper"].ended is not None
        assert state.limbs["gripper"].ended.outcome == "stopped"
        goals.until(lambda told: CANCELED in [goal.status for goal in told.status_list])
