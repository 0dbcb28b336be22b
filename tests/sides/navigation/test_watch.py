"""The gate watches a robot that drives itself. The watchdog, the map and the arm also limit such drives."""

from __future__ import annotations

import math
import signal
import time

import pytest
from msgspec.structs import replace

from robots.shared.configuration.bridge_config import Topic
from tests.processes import until
from tests.ros.bridge_support import running_bridge
from tests.sides.navigation.traveller import FAR, NEAR, in_control, pause, travelling
from tests.sides.visitor import place

BEHIND_THE_WALL = (1.2, 5.5)
WALL_Y_M = 3.5


def test_a_blind_planner_is_stopped_before_it_touches_anything(traveller, truth, fault):
    assert traveller.ended(traveller.go(*NEAR)).outcome == "arrived"  # south of a wall without a door
    fault("navigation_blind")
    seq = traveller.go(*BEHIND_THE_WALL)
    end = traveller.ended(seq)
    assert (end.outcome, end.because) == ("held_back", "obstacle")
    assert "laser" in end.text
    traveller.stands()
    _, y, _ = place(truth)
    assert 0.0 < WALL_Y_M - y - 0.27 < 0.4
    until(lambda: "go.end held_back" in traveller.process.recorded(), "the end on record")
    assert "gate.begin obstacle" in traveller.process.recorded()
    fault("none")  # navigation without a fault may drive on from there
    end = traveller.ended(traveller.go(2.0, 1.8))
    assert end.outcome == "arrived", end


def test_a_silent_laser_ends_a_drive(traveller, fault):
    seq = traveller.go_away()
    traveller.drives()
    fault("laser_dead")
    end = traveller.ended(seq)
    assert (end.outcome, end.because) == ("held_back", "scan_stale")
    traveller.stands()


def test_a_bridge_that_dies_leaves_no_robot_that_drives_itself(traveller, truth, rests):
    traveller.go_away()
    traveller.drives()
    traveller.process.kill()
    rests()
    truth.drain()
    truth.until(lambda pose: abs(pose.twist.twist.linear.x) < 0.01 > abs(pose.twist.twist.angular.z))
    before = place(truth)
    time.sleep(2.0)  # longer than the time of zeros after a person's drive
    assert math.dist(before[:2], place(truth)[:2]) < 0.02


def test_a_bridge_that_hung_knows_its_watchdogs_cancel(traveller, rests):
    """It is no other program's, although both arrive while the bridge hangs."""
    seq = traveller.go_away()
    traveller.drives()
    traveller.process.process.send_signal(signal.SIGSTOP)
    try:
        rests()
    finally:
        traveller.process.process.send_signal(signal.SIGCONT)
    end = traveller.ended(seq)
    assert end.outcome == "overloaded" and "the bridge was 1." in end.text


@pytest.fixture
def with_arm(side, robot, tmp_path, config):
    gate = replace(config.gate, has_arm=True)
    with travelling(replace(config, gate=gate), side, tmp_path) as traveller:
        yield traveller


def test_an_arm_whose_place_is_unknown_refuses(with_arm):
    pause(with_arm, 0.5)
    assert with_arm.refused(*FAR).code == "arm_away"


@pytest.fixture
def on_other_map(side, robot, tmp_path, config):
    other = Topic("/other_map", side.type("nav_msgs/OccupancyGrid"))
    with travelling(replace(config, topics=replace(config.topics, map=other)), side, tmp_path) as traveller:
        yield traveller


def test_without_a_map_goals_are_refused(on_other_map):
    traveller = on_other_map
    pause(traveller, 6.0)
    assert traveller.refused(*FAR).code == "no_map"


def test_without_a_watchdog_nobody_is_sent(side, robot, tmp_path, config):
    with running_bridge(config, side, tmp_path) as (process, hand):
        traveller = in_control(process, hand)
        traveller.until(lambda state: state.watchdog_missing, "a missing watchdog")
        assert traveller.refused(*FAR).code == "watchdog_missing"
