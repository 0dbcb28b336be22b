"""The gate watches a robot that drives itself. The watchdog, the map and the arm also limit such drives."""

from __future__ import annotations

import math
import signal
from contextlib import contextmanager

import pytest
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from nav_msgs.msg import OccupancyGrid

from robots.bridge.ros.network.master_monitor import SURVEY_S
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import WatchdogProcess, drivable, running_bridge, tiago_config
from tests.ros.navigation.conftest import FAR, NEAR, TOPICS, Traveller, guarded_bridge, pause, place

BEHIND_THE_WALL = (1.2, 5.5)
WALL_Y_M = 3.5
NOTICED_S = 2.0 * SURVEY_S


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
    assert traveller.ended(traveller.go(2.0, 1.8)).outcome == "arrived"


def test_a_silent_laser_ends_a_drive(traveller, fault):
    seq = traveller.go_away()
    traveller.drives()
    fault("laser_dead")
    end = traveller.ended(seq)
    assert (end.outcome, end.because) == ("held_back", "scan_stale")
    traveller.stands()


def test_a_bridge_that_dies_leaves_no_robot_that_drives_itself(ros, rosmaster, tmp_path, config, truth):
    watchdog = WatchdogProcess(config, rosmaster, tmp_path)
    try:
        watchdog.ready()
        with running_bridge(config, rosmaster, tmp_path) as (process, hand):
            hand.state_until(drivable, "a robot that can be driven")
            hand.take_control(1)
            hand.let_go()
            traveller = Traveller(process, hand)
            traveller.go_away()
            traveller.drives()
            with ros.listen("/move_base/status", GoalStatusArray) as statuses:
                process.kill()
                statuses.until(
                    lambda message: all(one.status != GoalStatus.ACTIVE for one in message.status_list)
                )
            truth.drain()
            truth.until(lambda pose: abs(pose.twist.twist.linear.x) < 0.01 > abs(pose.twist.twist.angular.z))
            before = place(truth)
            rospy.sleep(2.0)  # longer than the time of zeros after a person's drive
            assert math.dist(before[:2], place(truth)[:2]) < 0.02
    finally:
        watchdog.stop()


def test_a_bridge_that_hung_knows_its_watchdogs_cancel(ros, traveller):
    """It is no other program's, although both arrive while the bridge hangs."""
    seq = traveller.go_away()
    traveller.drives()
    with ros.listen("/move_base/status", GoalStatusArray) as statuses:
        traveller.process.process.send_signal(signal.SIGSTOP)
        try:
            statuses.until(
                lambda message: all(one.status != GoalStatus.ACTIVE for one in message.status_list)
            )
        finally:
            traveller.process.process.send_signal(signal.SIGCONT)
    end = traveller.ended(seq)
    assert end.outcome == "overloaded" and "the bridge was 1." in end.text


@pytest.fixture
def with_arm(rosmaster, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics=TOPICS, gate={"has_arm": True})
    with guarded_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.let_go()
        yield Traveller(process, hand)


def test_an_arm_whose_place_is_unknown_refuses(with_arm):
    pause(with_arm, 0.5)
    assert with_arm.refused(*FAR).code == "arm_away"


@contextmanager
def published(floor: int):
    """A map of an empty floor, 20 m wide, on a topic of its own."""
    publisher = rospy.Publisher("/other_map", OccupancyGrid, queue_size=1, latch=True)
    try:
        publisher.publish(grid(floor))
        yield publisher
    finally:
        publisher.unregister()


@contextmanager
def passing_publisher(rosmaster):
    """Another node that publishes the map for a moment, and cannot be reached."""
    master, uri = rosgraph.Master("/passing", rosmaster.uri), "http://127.0.0.1:9/"
    master.registerPublisher("/other_map", "nav_msgs/OccupancyGrid", uri)
    yield
    master.unregisterPublisher("/other_map", uri)


def grid(cells: int) -> OccupancyGrid:
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = 0.1, cells, cells
    message.info.origin.position.x = message.info.origin.position.y = -5.0
    message.info.origin.orientation.w = 1.0
    message.data = [0] * (cells * cells)
    return message


@contextmanager
def also_published(maps: OccupancyGrid):
    """A second node, this one, publishes the robot's map."""
    publisher = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
    try:
        publisher.publish(maps)
        yield publisher
    finally:
        publisher.unregister()


@pytest.fixture
def on_other_map(rosmaster, tmp_path):
    config = tiago_config(
        rosmaster, tmp_path, topics={**TOPICS, "map": Topic("/other_map", "nav_msgs/OccupancyGrid")}
    )
    with guarded_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.let_go()
        yield Traveller(process, hand)


def test_without_a_map_goals_are_refused(on_other_map):
    traveller = on_other_map
    pause(traveller, 6.0)
    assert traveller.refused(*FAR).code == "no_map"


def test_a_map_that_changes_or_ends_ends_a_drive(truth, rosmaster, tmp_path):
    config = tiago_config(
        rosmaster, tmp_path, topics={**TOPICS, "map": Topic("/other_map", "nav_msgs/OccupancyGrid")}
    )
    with published(200) as maps, guarded_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.let_go()
        traveller = Traveller(process, hand)
        pause(traveller, 1.0)
        seq = traveller.go(*NEAR)
        traveller.ended(seq)
        seq = traveller.go(*FAR)
        with passing_publisher(rosmaster):
            pause(traveller, NOTICED_S)
            assert traveller.drives().going_ended.seq != seq
            maps.publish(grid(150))
        end = traveller.ended(seq)
        assert (end.outcome, end.text) == ("map_changed", "The robot’s map changed.")
        traveller.stands()
        posed = wire.SetPose(traveller.fence, *place(truth), seq + 1_000)
        with traveller.renewing():  # the node that has gone makes the map unknown for a moment
            until(lambda: hand.ask(posed) is None, "a pose on this map: the one before is none on it")
        maps.unregister()
        assert traveller.drives_until_ended().outcome == "map_gone"
        traveller.stands()


def test_nodes_with_different_maps_end_a_drive(traveller, robot):
    office = rospy.wait_for_message("/map", OccupancyGrid, PATIENCE_S)
    seq = traveller.go_away()
    traveller.drives()
    with also_published(grid(200)) as other:
        end = traveller.ended(seq)
        assert end.outcome == "map_gone"
        traveller.stands()
        refusal = traveller.refused(*traveller.goal)
        assert refusal.code == "no_map"
        for told in (end.text, refusal.text):
            assert robot.node in told and rospy.get_name() in told and "different maps" in told
        other.publish(office)
        seq = traveller.go(*traveller.goal)
        traveller.drives()
    assert traveller.ended(seq).outcome == "arrived"


def test_without_a_watchdog_nobody_is_sent(rosmaster, tmp_path, config):
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.let_go()
        traveller = Traveller(process, hand)
        traveller.until(lambda state: state.watchdog_missing, "a missing watchdog")
        assert traveller.refused(*FAR).code == "watchdog_missing"
