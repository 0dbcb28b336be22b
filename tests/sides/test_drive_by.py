"""Drives by a distance and by an angle."""

from __future__ import annotations

import itertools
import math
import time

import pytest

from robots.bridge.drive.drive_by import CONFIRMED_S
from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import drivable, renewing, running_bridge
from tests.sides.visitor import place

_numbers = itertools.count(1)
START = (3.4, 1.8, 0.0)
WALL_Y_M = 3.5  # north of there


@pytest.fixture
def bridge(side, robot, config, visitor, tmp_path):
    """A bridge, and the holder of control: a program without a stick. It has seen no other place than the start."""
    with visitor.at(*START), running_bridge(config, side, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.let_go()
        yield process, hand


def renew(hand) -> None:
    """Renew control as a web process does."""
    hand.send(wire.Grant(1, 3.0, "session-1", "Ann", "ann", 1.0))


def begun(hand, **goal) -> int:
    """Ask for a drive; return its number."""
    renew(hand)
    seq = next(_numbers)
    assert hand.ask(wire.DriveBy(1, seq=seq, **goal)) is None
    return seq


def driving(hand, seconds: float) -> None:
    """Renew control for this number of seconds, so that the drive goes on."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        renew(hand)
        time.sleep(0.2)


def ended(hand, seq: int) -> wire.DriveByEnd:
    """Renew control until the drive ends; return its end."""

    def over(state: wire.State) -> bool:
        renew(hand)
        end = state.drive_by_ended
        return end is not None and end.seq == seq

    end = hand.state_until(over, f"the end of drive {seq}").drive_by_ended
    assert end is not None
    return end


def is_zero(twist) -> bool:
    return twist.linear.x == twist.linear.y == twist.angular.z == 0.0


def test_a_metre_a_quarter_turn_and_up_to_a_wall(visitor, bridge):
    process, hand = bridge
    with visitor.listen("/ground_truth/pose", "nav_msgs/Odometry") as truth:
        x, y, _ = place(truth)
        end = ended(hand, begun(hand, distance_m=1.0))
        assert end.outcome == "done"
        assert end.distance_m == pytest.approx(1.0, abs=0.03)
        after_x, after_y, heading = place(truth)
        assert math.hypot(after_x - x, after_y - y) == pytest.approx(1.0, abs=0.03)

        end = ended(hand, begun(hand, angle_rad=math.pi / 2))
        assert end.outcome == "done"
        assert math.degrees(end.angle_rad) == pytest.approx(90.0, abs=2.0)
        turned = math.degrees(math.remainder(place(truth)[2] - heading, math.tau))
        assert turned == pytest.approx(90.0, abs=2.0)

        end = ended(hand, begun(hand, distance_m=5.0))
        assert (end.outcome, end.because) == ("held_back", "obstacle")
        assert "laser" in end.text
        assert 0.0 < WALL_Y_M - place(truth)[1] - 0.27 < 0.3
    until(lambda: process.recorded()[-1] == "drive.end", "the end on record")
    assert [line for line in process.recorded() if line.startswith("drive.by")] == [
        "drive.by 1.0 0.4",
        "drive.by done",
        "drive.by 1.5707963267948966 0.838",
        "drive.by done",
        "drive.by 5.0 0.4",
        "drive.by held_back",
    ]
    assert hand.state.stop.state == "clear"


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_observer_sees_zeros_after_a_stop(visitor, bridge, direction):
    process, hand = bridge
    with visitor.listen("/key_vel", "geometry_msgs/Twist") as twists:
        visitor.connected(twists)
        seq = begun(hand, angle_rad=direction * math.tau, speed_radps=0.5)
        with renewing(lambda: renew(hand)):
            twists.until(lambda twist: twist.angular.z * direction > 0.3)
        hand.send(wire.LinkStop("Bob"))
        end = ended(hand, seq)
        hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
        twists.settle()
        time.sleep(1.0)
        seen = twists.drain()
    assert end.outcome == "stopped"
    assert 0.0 < end.angle_rad * direction < 1.0
    assert len(seen) > 10 and all(map(is_zero, seen))
    until(lambda: "drive.by stopped" in process.recorded(), "its end on record")


def test_the_stick_takes_over_and_a_closed_link_stops_it(visitor, bridge):
    process, hand = bridge
    with visitor.listen("/key_vel", "geometry_msgs/Twist") as twists:
        visitor.connected(twists)
        seq = begun(hand, angle_rad=math.tau, speed_radps=0.5)
        driving(hand, 0.5)
        hand.stick(0.0, 0.0)
        driving(hand, 0.5)
        assert hand.state.drive_by is not None
        hand.stick(0.0, -0.5)
        assert ended(hand, seq).outcome == "replaced"
        twists.until(lambda twist: twist.angular.z < -0.3)
        hand.stick(0.0, 0.0)
        hand.state_until(lambda state: abs(state.odometry.w) < 0.02, "standstill")
        hand.let_go()

        begun(hand, angle_rad=math.tau, speed_radps=0.5)
        driving(hand, 0.5)
        hand.close()
        twists.drain()
        on_their_way = itertools.takewhile(lambda twist: not is_zero(twist), iter(twists.next, None))
        assert len(list(on_their_way)) <= 2
    until(lambda: "drive.by control_lost" in process.recorded(), "its end on record")


def test_an_unconfirmed_program_stops_before_its_grant_ends(bridge):
    _, hand = bridge
    seq = begun(hand, angle_rad=math.tau, speed_radps=0.3)
    end = hand.state_until(
        lambda state: state.drive_by_ended and state.drive_by_ended.seq == seq, "its end"
    ).drive_by_ended
    assert end.outcome == "control_lost"
    assert end.angle_rad < 0.3 * (CONFIRMED_S + 0.5)
