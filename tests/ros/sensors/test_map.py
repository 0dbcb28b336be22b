"""The robot's map, from ROS to the console's table, fetched while a person has control."""

from __future__ import annotations

import math
import socket
from contextlib import contextmanager
from io import BytesIO

import numpy as np
import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import OccupancyGrid, Odometry
from PIL import Image
from tf2_msgs.msg import TFMessage

from fleet.site.management.commands.seed_demo import seed_map
from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.bridge.robot.sensors.on_demand_topics import OnDemandTopics
from robots.bridge.robot.worker import Worker
from robots.bridge.ros.sensors.map import read_map
from robots.bridge.ros.sensors.tf import TfTopics
from robots.places.selectors import place_of_robot
from robots.records.bridge_records import AuditSink
from robots.registry.models import RobotMap
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros1
from robots.shared.records.record_sink import TakenMap
from tests.processes import until
from tests.ros.support import Master

MAP = Topic("/map", "nav_msgs/OccupancyGrid")


@pytest.fixture(scope="module", autouse=True)
def simulated(ros, simulator):
    return simulator(world="office", pose="2.0,1.8,0", seed=3)


def opacity(shown: TakenMap | RobotMap, x: float, y: float) -> int:
    """Return the picture's opacity at a place of the simulated world: 34 free, 255 occupied, 0 unknown."""
    origin = shown.origin if isinstance(shown, TakenMap) else (shown.origin_x_m, shown.origin_y_m)
    with Image.open(BytesIO(shown.picture)) as picture:
        pixels = np.array(picture.convert("RGBA"))
    row, column = (y - origin[1]) / shown.resolution_m, (x - origin[0]) / shown.resolution_m
    return int(pixels[shown.height - 1 - math.floor(row), math.floor(column), 3])


@pytest.mark.django_db(transaction=True)
def test_the_simulated_map_is_stored_with_its_walls(rosmaster, robot):
    taken = read_map(MapWanted(Ros1(rosmaster.uri), MAP))
    assert isinstance(taken, TakenMap)
    sink = AuditSink(robot.pk, robot.name)
    sink.keep_map(taken)
    sink.keep_map(taken)  # the bridge does this five minutes later
    [shown] = RobotMap.objects.filter(robot=robot)
    assert shown.last_seen_at > shown.first_seen_at
    # The hall, its west wall, the cupboard's side and its unseen inside.
    places = [(2.0, 1.8), (0.03, 3.0), (0.58, 1.0), (0.35, 1.0)]
    assert [opacity(shown, *place) for place in places] == [34, 255, 255, 0]
    seed_map([robot])  # the map to which script/demo gives places
    assert place_of_robot(robot.id, "kitchen").map_id == taken.digest
    assert RobotMap.objects.filter(robot=robot).count() == 1


def test_the_map_pose_is_known_without_a_depth_camera(ros):
    with ros.listen("/ground_truth/pose", Odometry) as truth:
        at = truth.next().pose.pose.position
    tf = TfTopics()
    on_demand = OnDemandTopics(Worker("topics"), tf)
    on_demand.set_wanted(True)
    _, pose = until(tf.located, "a place")
    assert (pose.x, pose.y) == pytest.approx((at.x, at.y), abs=0.1)  # it has not driven: its odometry is zero
    on_demand.set_wanted(False)
    until(lambda: tf.located() is None, "nothing is known any more")


def test_the_simulated_pose_is_right_within_centimetres(ros, simulated):
    with ros.listen("/tf", TFMessage) as tf, ros.speak("/ground_truth/teleport", Pose2D) as teleport:

        def believed():
            while True:
                for moved in tf.next().transforms:
                    if (moved.header.frame_id, moved.child_frame_id) == ("map", "odom"):
                        place, turn = moved.transform.translation, moved.transform.rotation
                        return place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)

        assert believed() == pytest.approx((2.0, 1.8, 0.0), abs=0.1)  # odometry starts here
        teleport.publish(Pose2D(3.0, 1.8, 0.0))
        while believed() != pytest.approx((3.0, 1.8, 0.0), abs=0.1):
            pass  # a robot that somebody carried is localised again at once; its odometry stays


def test_a_bad_map_and_a_missing_map_are_refused(ros, rosmaster, monkeypatch):
    monkeypatch.setattr("robots.bridge.ros.sensors.map.MESSAGE_S", 0.5)
    wanted = MapWanted(Ros1(rosmaster.uri), Topic("/hostile_map", MAP.type))
    hostile = rospy.Publisher("/hostile_map", OccupancyGrid, queue_size=1, latch=True)
    try:
        silent = read_map(wanted)
        assert isinstance(silent, NoMap)
        assert "has published no map yet" in silent.why
        grid = OccupancyGrid()
        grid.header.frame_id = "map"
        grid.info.resolution, grid.info.width, grid.info.height = math.nan, 2, 2
        grid.info.origin.orientation.w = 1.0
        grid.data = [0] * 4
        hostile.publish(grid)
        refused = read_map(wanted)
        assert isinstance(refused, NoMap)
        assert "nan m wide" in refused.why
    finally:
        hostile.unregister()


@contextmanager
def registered(rosmaster, uri: str):
    """Another publisher of the map, as the master knows it."""
    master = rosgraph.Master("/second", rosmaster.uri)
    master.registerPublisher(MAP.name, MAP.type, uri)
    try:
        yield
    finally:
        master.unregisterPublisher(MAP.name, uri)


def test_a_publisher_that_has_ended_hides_no_map(rosmaster):
    with registered(rosmaster, "http://127.0.0.1:9/"):
        assert isinstance(read_map(MapWanted(Ros1(rosmaster.uri), MAP)), TakenMap)


def test_a_publisher_that_hangs_makes_the_map_unknown(rosmaster):
    with (
        socket.create_server(("127.0.0.1", 0)) as hangs,
        registered(rosmaster, f"http://127.0.0.1:{hangs.getsockname()[1]}/"),
    ):
        found = read_map(MapWanted(Ros1(rosmaster.uri), MAP))
    assert isinstance(found, NoMap)
    assert "/second: it does not answer at http://127.0.0.1" in found.why
    assert "rosnode cleanup" in found.why


@pytest.mark.parametrize("latched", [True, False])
def test_a_latched_topic_without_a_map_hides_none(ros, rosmaster, monkeypatch, latched):
    monkeypatch.setattr("robots.bridge.ros.sensors.map.MESSAGE_S", 0.5)
    silent = rospy.Publisher(MAP.name, OccupancyGrid, queue_size=1, latch=latched)
    try:
        assert isinstance(read_map(MapWanted(Ros1(rosmaster.uri), MAP)), TakenMap if latched else NoMap)
    finally:
        silent.unregister()


def test_without_a_master_it_says_so(tmp_path):
    found = read_map(MapWanted(Ros1(Master(tmp_path).uri), MAP))
    assert isinstance(found, NoMap)
    assert "No ROS master answers" in found.why
