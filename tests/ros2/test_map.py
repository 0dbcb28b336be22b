"""The map process of a robot with ROS 2, at the simulated robot."""

from __future__ import annotations

import msgspec
import pytest

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.records.record_sink import TakenMap
from robots.shared.ros2.environment import domain_environment
from tests.forked import ROS2, answer_of
from tests.processes import until
from tests.ros2.side import needs_rclpy

pytestmark = [needs_rclpy, pytest.mark.usefixtures("robot")]


def fetched(domain: int, topic: Topic) -> TakenMap | NoMap:
    wanted = msgspec.json.encode(MapWanted(Ros2(domain, "localhost"), topic))
    answer = answer_of("robots.bridge.ros2.sensors.map", wanted, domain_environment(domain), ROS2)
    return msgspec.msgpack.decode(answer, type=TakenMap | NoMap)


def published(domain: int) -> TakenMap | None:
    """Return the map; None: the robot has only begun."""
    found = fetched(domain, Topic("/map", "nav_msgs/msg/OccupancyGrid"))
    return None if isinstance(found, NoMap) and not found.is_certain else found


def test_the_map_is_fetched_whole(domain: int) -> None:
    found = until(lambda: published(domain), "the map")
    assert found.resolution_m == 0.05 and found.width > 50
