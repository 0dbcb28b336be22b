"""Stamps of other clocks while a person drives: the robot stands and says why, or drives on."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from tests.ros.bridge_support import Hand
from tests.sides.side import Side
from tests.sides.turning import stands, turn
from tests.sides.visitor import Visitor

HOUR_S = 3600.0
BEGAN_S = 100.0  # of the simulated clock
ODOMETRY_NODE = "/simulator_tiago_1"  # with ROS 2 it says whether it follows a simulated clock


def test_a_laser_with_another_clock_stops_the_robot_and_is_named(
    hand: Hand, fault: Callable[[str], None]
) -> None:
    turn(hand)
    fault(f"laser_ahead_s={HOUR_S}")
    assert "stamps" in stands(hand, "scan_unpaired").text
    [laser] = [sensor for sensor in hand.news().sensors if sensor.kind == "scan"]
    assert not laser.ok and "stamps" in laser.text
    fault("none")
    turn(hand)


@pytest.mark.parametrize("ahead_s", [HOUR_S, -HOUR_S], ids=["ahead", "back"])
def test_a_clock_that_is_set_costs_a_neutral_stick_at_most(
    hand: Hand, fault: Callable[[str], None], ahead_s: float
) -> None:
    turn(hand)
    fault(f"clock_ahead_s={ahead_s}")
    if ahead_s < 0.0:
        assert stands(hand, "odometry_anew").text
    turn(hand, lambda state: state.clock_skew_s and abs(state.clock_skew_s - ahead_s) < 60.0)


def test_a_simulated_clock_begins_and_ends_during_a_drive(
    side: Side, visitor: Visitor, hand: Hand, fault: Callable[[str], None]
) -> None:
    def simulated(whether: bool) -> None:
        visitor.set_parameter("" if side.number == 1 else ODOMETRY_NODE, "use_sim_time", whether)

    turn(hand)
    simulated(True)
    with visitor.speak("/clock", "rosgraph_msgs/Clock", listeners=0) as clock:
        clock.repeat(20.0, clock=BEGAN_S)
        fault(f"clock_ahead_s={BEGAN_S - time.time()}")
        assert stands(hand, "odometry_anew").text
        turn(hand, lambda state: state.clock_skew_s is None)  # it is known as simulated, not as wrong
    simulated(False)
    fault("none")
    turn(hand, lambda state: state.clock_skew_s is not None)  # it is compared again


def test_a_clock_of_strangers_hides_no_skew(
    visitor: Visitor, hand: Hand, fault: Callable[[str], None]
) -> None:
    """Such as of a recording that somebody plays: the robot's own nodes do not follow it."""
    fault(f"clock_ahead_s={HOUR_S}")
    turn(hand, lambda state: state.clock_skew_s)
    with visitor.speak("/clock", "rosgraph_msgs/Clock", listeners=0) as clock:
        clock.repeat(20.0, clock=BEGAN_S)
        with visitor.speak("/key_vel", "geometry_msgs/Twist"):
            hand.state_until(lambda state: state.foreign, "a survey that also sees the clock")
        state = hand.state_until(lambda state: not state.foreign, "one more survey")
        assert state.clock_skew_s and abs(state.clock_skew_s - HOUR_S) < 60.0
