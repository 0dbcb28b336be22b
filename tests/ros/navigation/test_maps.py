"""A robot whose map changes, ends, or is one of several."""

from __future__ import annotations

from contextlib import contextmanager

import rosgraph
import rospy
from nav_msgs.msg import OccupancyGrid

from robots.bridge.ros.network.master_monitor import SURVEY_S
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from tests.processes import PATIENCE_S, until
from tests.sides.navigation.traveller import FAR, NEAR, pause, travelling
from tests.sides.visitor import place

NOTICED_S = 2.0 * SURVEY_S


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


def test_a_map_that_changes_or_ends_ends_a_drive(side, truth, rosmaster, tmp_path):
    other = Topic("/other_map", "nav_msgs/OccupancyGrid")
    config = side.config(tmp_path, "navigation", topics={"map": other})
    with published(200) as maps, travelling(config, side, tmp_path) as traveller:
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
            until(
                lambda: traveller.hand.ask(posed) is None, "a pose on this map: the one before is none on it"
            )
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
