"""The bridge at a simulated robot: it drives by the stick, and stands when nobody asks for motion any more."""

from __future__ import annotations

import itertools
import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest

from robots.shared import wire
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from tests.processes import until
from tests.ros.bridge_support import BridgeProcess

ODOMETRY, DRIVE = "/mobile_base_controller/odom", "/key_vel"


@pytest.fixture
def odometry(visitor, robot):
    with visitor.listen(ODOMETRY, "nav_msgs/Odometry") as odometry:
        yield odometry


@pytest.fixture
def twists(visitor, robot):
    with visitor.listen(DRIVE, "geometry_msgs/Twist") as twists:
        yield twists


def moving(message: SimpleNamespace) -> bool:
    return abs(message.twist.twist.angular.z) > 0.2


def still(message: SimpleNamespace) -> bool:
    return abs(message.twist.twist.linear.x) < 0.01 and abs(message.twist.twist.angular.z) < 0.02


def is_zero(twist: SimpleNamespace) -> bool:
    return twist.linear.x == twist.linear.y == twist.angular.z == 0.0


def test_the_stick_turns_the_robot_and_letting_go_stops_it(odometry, hand):
    hand.stick(0.0, 0.5)
    odometry.until(moving)
    hand.let_go()
    odometry.until(still, timeout_s=2.0)
    hand.state_until(lambda state: state.neutral_needed, "the bridge to ask for a neutral stick")


def test_the_drive_is_recorded_from_start_to_end(odometry, hand, bridge):
    hand.stick(0.0, 0.5)
    odometry.until(moving)
    hand.stick(0.0, 0.0)
    odometry.until(still)
    until(lambda: "drive.end" in bridge.recorded(), "the end on record")
    assert bridge.recorded()[0] == "drive.start"


def test_a_closed_link_stops_the_robot(odometry, twists, hand):
    hand.stick(0.0, 0.5)
    odometry.until(moving)
    hand.close()
    twists.drain()
    on_their_way = itertools.takewhile(lambda twist: not is_zero(twist), iter(twists.next, None))
    assert len(list(on_their_way)) <= 2  # with the dead-man alone there would be five
    odometry.until(still)


def test_a_bridge_without_supervisor_stops_the_robot_and_ends(odometry, twists, hand, bridge):
    hand.stick(0.0, 0.5)
    odometry.until(moving)
    twists.next()  # the visitor hears the bridge by now, too
    assert bridge.cut_life_line() == 0
    until(lambda: not twists.publishers, "the end of its connection")
    *_, last = twists.drain()
    assert is_zero(last)
    odometry.until(still)
    assert not Path(bridge.config.link.unix_path).exists()


def test_the_socket_opens_for_its_owner_only(hand, bridge):
    assert stat.S_IMODE(os.stat(bridge.config.link.unix_path).st_mode) == 0o600


def test_a_second_bridge_on_this_machine_goes_at_once(hand, start):
    assert start(BridgeProcess).process.wait(20) == EXIT_ALREADY_RUNNING


def test_another_publisher_on_the_drive_topic_is_shown(visitor, hand):
    with visitor.speak(DRIVE, "geometry_msgs/Twist"):
        state = hand.state_until(lambda state: state.foreign, "the foreign publisher")
    assert state.foreign == [visitor.name]


def test_rubbish_on_the_link_is_answered_and_the_link_stays(hand):
    hand._socket.send("{not json")
    refused = hand.until(lambda report: isinstance(report, wire.Refused), "an answer")
    assert refused.refusal.code == "not_json"
    hand.stick(0.0, 0.1)
    hand.state_until(lambda state: state.verdict.asked[2] > 0, "driving goes on")
