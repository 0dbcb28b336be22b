"""A navigation that passes by the mux and ignores cancels: the console says that the stopped robot moves."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import rospy
from geometry_msgs.msg import Twist

from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

COMMAND = "/mobile_base_controller/cmd_vel"


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture
def config(rosmaster, tmp_path):
    return tiago_config(rosmaster, tmp_path)


@contextmanager
def rogue(ros) -> Iterator[None]:
    """Turn the base by its controller's own topic, 100 times a second, whatever the console sends or cancels."""
    over, twist = threading.Event(), Twist()
    twist.angular.z = 0.5

    def drive(publisher) -> None:
        while not over.wait(0.01):
            publisher.publish(twist)

    with ros.speak(COMMAND, Twist) as publisher:
        thread = threading.Thread(target=drive, args=[publisher], daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def told(state: wire.State) -> wire.MovesAlthoughStopped | None:
    return state.moves_although_stopped


def is_named(state: wire.State) -> bool:
    """Return whether the state says that the robot moves, and names this process."""
    moves = told(state)
    return moves is not None and rospy.get_name() in moves.publishers.get(COMMAND, [])


def test_a_stopped_robot_that_drives_on(ros, rosmaster, config, tmp_path, fault):
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        with rogue(ros):
            hand.state_until(lambda state: abs(state.odometry.w) > 0.2, "a robot that turns")
            hand.send(wire.LinkStop("Bob"))
            state = hand.state_until(is_named, "the robot moves although it is stopped")
            assert told(state).parts == ["base"] and state.stop.by == "Bob"
            assert abs(told(state).turn_radps) > 0.0 and state.stands is False
            until(lambda: "stop.moves" in " ".join(process.recorded()), "the record")
            fault("odom_dead")
            unknown = hand.state_until(
                lambda state: told(state) and told(state).turn_radps is None, "an unknown motion"
            )
            assert unknown.stands is None and "nobody knows" in told(unknown).text
            fault("none")
            process.kill()
            with running_bridge(config, rosmaster, tmp_path) as (_, again):
                again.state_until(is_named, "the next bridge says it, too")
    # the second bridge ended with the robot stopped


def test_the_event_ends_when_the_robot_stands(ros, rosmaster, config, tmp_path):
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.send(wire.LinkStop("Bob"))
        hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
        time.sleep(1.0)
        assert told(hand.state) is None
        with rogue(ros):
            hand.state_until(is_named, "the robot moves although it is stopped")
        hand.state_until(lambda state: told(state) is None and state.stands, "a robot that stands")
        until(lambda: "stop.moves stood" in process.recorded(), "the end on record")
        assert sum(line.startswith("stop.moves ") for line in process.recorded()) == 2
