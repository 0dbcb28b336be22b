"""A press reaches the robot within `ZERO_S`, whatever strangers do in its domain. Long: see tests/long.txt."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.watchdog_config import lane_path
from tests.ros.bridge_support import Hand, drivable, guarded_bridge
from tests.ros2.conftest import free_domain
from tests.ros2.hostile.test_strangers import stranger
from tests.ros2.side import Side, needs_rclpy
from tests.sides.side import Ros2Side
from tests.sides.visitor import Inbox, Visitor

pytestmark = needs_rclpy
ZERO_S = 0.35  # from the press to the first zero that another process hears
PRESSES = 6
STRANGERS = {
    "nobody": [],
    "huge_odometry": [("huge_odometry", "100000000")],
    "huge_log": [("huge_log", "100000000")],
    "five_huge": [("huge_odometry", "100000000")] * 2 + [("huge_log", "100000000")] * 3,
    "tiny": [("tiny",)],
    "names": [("names", "1000000")],
    "topics": [("topics", "10000")],
    "servers": [("servers", "6000")],
    "comers": [("comers",)],
    "huge_map": [("huge_map", "10000")],
}
DEEDS = {"topics": 10_000, "servers": 6000, "comers": 5000}  # before the first press


@pytest.fixture(scope="module", params=STRANGERS)
def role(request: pytest.FixtureRequest) -> str:
    found: str = request.param
    return found


@pytest.fixture(scope="module")
def domain(role: str) -> Iterator[int]:
    """A domain for each case: strangers that die without a word stay in it for 20 s."""
    with free_domain() as found:
        yield found


@pytest.fixture
def config(network: Ros2Side, tmp_path: Path) -> BridgeConfig:
    """Of a robot with everything that a stop ends."""
    return network.config(
        tmp_path, "depth", "joint_states", "speech", "motions", "torso", "map", "navigation"
    )


@pytest.fixture
def hand(network: Ros2Side, robot: Side, config: BridgeConfig, tmp_path: Path) -> Iterator[Hand]:
    with guarded_bridge(config, network, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield hand


def test_a_press_stops_the_robot(
    role: str, domain: int, config: BridgeConfig, hand: Hand, visitor: Visitor
) -> None:
    took = []
    with ExitStack() as stack:
        twists = stack.enter_context(visitor.listen("/key_vel", "geometry_msgs/Twist"))
        for words in STRANGERS[role]:
            side = stack.enter_context(stranger(domain, *words))
            while int(side.await_line("done")[1]) < DEEDS.get(
                role, 1
            ):  # a line is awaited, not the whole work
                pass
        hand.take_control(1)
        for number in range(PRESSES):
            drive(hand, twists)
            pressed_s = time.monotonic()
            press(hand, config, by_watchdog=bool(number % 2))
            twists.until(lambda twist: not twist.linear.x)
            took.append(time.monotonic() - pressed_s)
            clear(hand, number)
    print(role, *(f"{one:.3f}" for one in took))
    assert max(took) < ZERO_S


def drive(hand: Hand, twists: Inbox) -> None:
    """Drive until the robot is told to move now. After a late scan, on a busy computer, the stick must rest first."""
    told = False
    while not told:
        hand.news()
        hand.drive_until(0.2, lambda state: state.odometry.vx > 0.02, "motion")
        twists.drain()
        told = twists.next().linear.x > 0.0


def press(hand: Hand, config: BridgeConfig, *, by_watchdog: bool) -> None:
    if not by_watchdog:
        hand.send(wire.LinkStop("ann", "enough"))
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane:
        lane.connect(lane_path(config))
        lane.send(wire.encode(wire.LinkStop("ann", "enough")))


def clear(hand: Hand, number: int) -> None:
    stopped: Any = hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
    hand.stick(0.0)
    hand.send(wire.LinkClear("ann", stopped.stop.number, seq=number + 1))
    hand.state_until(lambda state: state.stop.state == "clear", "a robot that may drive again")
