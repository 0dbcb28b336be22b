"""A stop reaches the robot and holds, also without the bridge: real processes, simulated robot."""

from __future__ import annotations

import os
import signal
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.probe_findings import watchdog_name
from tests.ros.bridge_support import BridgeProcess, Hand, WatchdogProcess
from tests.sides.side import Side
from tests.sides.visitor import Visitor
from tests.zeros import Zeros

DRIVE, TWIST = "/key_vel", "geometry_msgs/Twist"


@pytest.fixture
def bridge(start: Callable[..., Any], watchdog: WatchdogProcess) -> BridgeProcess:
    return start(BridgeProcess)


@pytest.fixture
def zeros(visitor: Visitor, config: BridgeConfig) -> Iterator[Zeros]:
    with visitor.listen(DRIVE, TWIST) as inbox:
        yield Zeros(inbox, watchdog_name(config.robot_id))


def turn(hand: Hand) -> None:
    """Turn the robot on the spot and keep the stick there."""

    def turns(state: wire.State) -> bool:
        hand.stick(0.0, 0.0 if state.neutral_needed else 0.5)
        return state.odometry is not None and state.odometry.w > 0.1

    hand.state_until(turns, "the robot to turn")


def press_and_clear(hand: Hand, watchdog: WatchdogProcess, zeros: Zeros) -> None:
    answer = watchdog.press("Ann", "smoke")
    assert answer == wire.Stopped(wire.StopState("stopping", "Ann", "smoke"), 7)
    stop = hand.state_until(lambda state: state.stop.state == "stopped", "the latch").stop
    assert (stop.by, stop.reason) == ("Ann", "smoke")
    zeros.of_the_watchdog()
    hand.send(wire.LinkClear("Ann", stop.number, 8))
    hand.state_until(lambda state: state.stop.state == "clear", "the clear")
    zeros.end()


def test_a_stop_is_latched_and_cleared_in_watchdog_and_bridge(
    hand: Hand, watchdog: WatchdogProcess, zeros: Zeros
) -> None:
    press_and_clear(hand, watchdog, zeros)
    turn(hand)


def test_one_press_by_both_ways_is_one_stop(hand: Hand, watchdog: WatchdogProcess) -> None:
    press = uuid.uuid4()
    hand.send(wire.LinkStop("Ann", "smoke", 5, press=press))
    first = hand.until(lambda report: isinstance(report, wire.Stopped), "the stop").stop
    watchdog.press("Ann", "smoke", press=press)
    watchdog.press("Ben", "")
    stop = hand.state_until(lambda state: state.stop.by == "Ben", "the second stop").stop
    assert stop.number == first.number + 1


def test_a_stop_is_not_refused_for_its_form(watchdog: WatchdogProcess, zeros: Zeros) -> None:
    answer = watchdog.say(b'{"t": "link_stop", "by": 7}')
    assert isinstance(answer, wire.Stopped) and answer.stop.by == "somebody"
    zeros.of_the_watchdog()


def test_another_robots_stop_is_refused(watchdog: WatchdogProcess, config: BridgeConfig) -> None:
    refused = watchdog.press(robot=uuid.uuid4())
    assert isinstance(refused, wire.Refused) and refused.refusal.code == "other_robot"
    assert isinstance(watchdog.press(robot=uuid.UUID(config.robot_id)), wire.Stopped)


def test_a_stop_survives_its_killed_bridge(
    hand: Hand, bridge: BridgeProcess, start: Callable[..., Any], zeros: Zeros
) -> None:
    hand.send(wire.LinkStop("Ann", "smoke", 5))
    hand.until(lambda report: isinstance(report, wire.Stopped), "the stop")
    bridge.kill()
    zeros.of_the_watchdog(20)
    again = start(BridgeProcess).link()
    stop = again.state_until(lambda state: state.stop.state == "stopped", "the latch").stop
    assert stop.by == "Ann"
    again.send(wire.LinkClear("Ann", stop.number, 8))
    again.state_until(lambda state: state.stop.state == "clear", "the clear")
    zeros.end()
    again.close()


def test_a_stop_without_bridge_reaches_robot_and_next_bridge(
    hand: Hand,
    bridge: BridgeProcess,
    watchdog: WatchdogProcess,
    start: Callable[..., Any],
    zeros: Zeros,
    visitor: Visitor,
    side: Side,
) -> None:
    bridge.kill()
    motions = side.topics.motions
    assert motions is not None
    wave = visitor.goal(motions.name, motions.type, motion_name="wave")
    assert wave.accepted()
    assert isinstance(watchdog.press("Ann", "smoke"), wire.Stopped)
    zeros.of_the_watchdog()
    assert wave.ended()[0] == "canceled"
    again = start(BridgeProcess).link()
    stop = again.state_until(lambda state: state.stop.state != "clear", "the latch").stop
    assert (stop.by, stop.reason) == ("Ann", "smoke")
    again.close()


def test_a_stop_known_to_the_watchdog_survives_it(
    hand: Hand, bridge: BridgeProcess, watchdog: WatchdogProcess, start: Callable[..., Any], zeros: Zeros
) -> None:
    bridge.kill()
    watchdog.press("Ann", "smoke")
    zeros.of_the_watchdog()
    watchdog.kill()
    start(WatchdogProcess)
    zeros.of_the_watchdog()
    again = start(BridgeProcess).link()
    assert again.state_until(lambda state: state.stop.state != "clear", "the latch").stop.by == "Ann"
    again.close()


def test_a_frozen_bridges_stop_is_confirmed_with_zeros(
    hand: Hand, bridge: BridgeProcess, watchdog: WatchdogProcess, zeros: Zeros
) -> None:
    bridge.process.send_signal(signal.SIGSTOP)
    try:
        assert isinstance(watchdog.press("Ann", "smoke"), wire.Stopped)
        zeros.of_the_watchdog(20)
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    hand.state_until(lambda state: state.stop.by == "Ann", "the latch")


@pytest.mark.parametrize("ends", [signal.SIGSTOP, signal.SIGKILL])
def test_a_robot_whose_bridge_falls_silent_gets_zeros(
    hand: Hand, bridge: BridgeProcess, watchdog: WatchdogProcess, zeros: Zeros, ends: signal.Signals
) -> None:
    # On a busy computer the watchdog finds the visitor seconds after the bridge has, and these zeros last one second
    press_and_clear(hand, watchdog, zeros)
    turn(hand)
    bridge.process.send_signal(ends)
    try:
        zeros.of_the_watchdog(3)
        zeros.end()
    finally:
        bridge.process.send_signal(signal.SIGCONT)


def test_the_consoles_own_watchdog_is_no_foreign_publisher(
    hand: Hand, watchdog: WatchdogProcess, visitor: Visitor
) -> None:
    with visitor.speak(DRIVE, TWIST):
        state = hand.state_until(lambda state: state.foreign, "a foreign publisher")
    assert state.foreign == [visitor.name]


def test_only_the_owner_opens_the_socket(watchdog: WatchdogProcess, config: BridgeConfig) -> None:
    path = config.link.unix_path
    assert path is not None
    assert os.stat(path.replace(".sock", ".stop")).st_mode & 0o777 == 0o600


def test_it_ends_with_its_life_line(watchdog: WatchdogProcess) -> None:
    assert watchdog.cut_life_line() == 0
