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
        if side.number == 1:
            visitor.set_parameter("", "use_sim_time", whether)

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
