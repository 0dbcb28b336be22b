"""A press reaches the robot within `ZERO_S`, whatever strangers do in its domain. Long: see tests/long.txt."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.watchdog_config import lane_path
from tests.ros.bridge_support import Hand, drivable
from tests.ros2.conftest import free_domain
from tests.ros2.hostile.test_strangers import stranger
from tests.ros2.side import needs_rclpy
from tests.ros2.test_bridge import bridge, config, hand, robot  # noqa: F401
from tests.ros2.test_simulator import Visitor

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
    "servers": [("servers", "10000")],
    "comers": [("comers",)],
    "huge_map": [("huge_map", "10000")],
}
DEEDS = {"topics": 10_000, "servers": 10_000, "comers": 100}  # before the first press


@pytest.fixture(scope="module", params=STRANGERS)
def role(request: pytest.FixtureRequest) -> str:
    found: str = request.param
    return found


@pytest.fixture(scope="module")
def domain(role: str) -> Iterator[int]:
    """A domain for each case: strangers that die without a word stay in it for 20 s."""
    with free_domain() as found:
        yield found


def test_a_press_stops_the_robot(role: str, domain: int, config: BridgeConfig, hand: Hand) -> None:  # noqa: F811
    hand.state_until(drivable, "a robot that can be driven")
    visitor = Visitor("tests.ros2.visitor", domain)
    visitor.ask(listen="/key_vel", kind="geometry_msgs/Twist")
    took = []
    with ExitStack() as stack:
        stack.callback(visitor.close)
        for words in STRANGERS[role]:
            side = stack.enter_context(stranger(domain, *words))
            side.await_line("done", lambda words: int(words[1]) >= DEEDS.get(role, 1))
        hand.take_control(1)
        for number in range(PRESSES):
            hand.drive_until(0.2, lambda state: state.odometry.vx > 0.02, "motion")
            visitor.forget()
            visitor.hear("/key_vel", lambda twist: twist["linear"]["x"] > 0.0)
            pressed_s = time.monotonic()
            press(hand, config, by_watchdog=bool(number % 2))
            visitor.hear("/key_vel", lambda twist: not twist["linear"]["x"])
            took.append(time.monotonic() - pressed_s)
            clear(hand, number)
    print(role, *(f"{one:.3f}" for one in took))
    assert max(took) < ZERO_S


def press(hand: Hand, config: BridgeConfig, *, by_watchdog: bool) -> None:  # noqa: F811
    if not by_watchdog:
        hand.send(wire.LinkStop("ann", "enough"))
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane:
        lane.connect(lane_path(config))
        lane.send(wire.encode(wire.LinkStop("ann", "enough")))


def clear(hand: Hand, number: int) -> None:  # noqa: F811
    stopped: Any = hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
    hand.stick(0.0)
    hand.send(wire.LinkClear("ann", stopped.stop.number, seq=number + 1))
    hand.state_until(lambda state: state.stop.state == "clear", "a robot that may drive again")
