"""The map process of a robot with ROS 2, at the simulated robot."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator

import msgspec
import pytest

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2, side_command
from robots.shared.records.record_sink import TakenMap
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from tests.processes import PATIENCE_S, REPOSITORY, until
from tests.ros2.side import Side, needs_rclpy

pytestmark = needs_rclpy


@pytest.fixture(scope="module", autouse=True)
def robot(domain: int) -> Iterator[Side]:
    options = (
        "--ros=2",
        "--name=tiago-9",
        "--world=office",
        "--pose=2,1.8,0",
        "--seed=1",
        "--exit-with-parent",
    )
    side = Side("robots.simulator", domain, *options)
    yield side
    side.close()


def environment(domain: int) -> dict[str, str]:
    return os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(domain)


def fetched(domain: int, topic: Topic) -> TakenMap | NoMap:
    done = subprocess.run(
        side_command(Ros2(), "sensors.map"),
        input=msgspec.json.encode(MapWanted(Ros2(domain, "localhost"), topic)),
        env=environment(domain),
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        check=True,
        timeout=PATIENCE_S,
    )
    return msgspec.msgpack.decode(done.stdout, type=TakenMap | NoMap)


def published(domain: int) -> TakenMap | None:
    """Return the map; None: the robot has only begun."""
    found = fetched(domain, Topic("/map", "nav_msgs/msg/OccupancyGrid"))
    return None if isinstance(found, NoMap) and not found.is_certain else found


def test_the_map_is_fetched_whole(domain: int) -> None:
    found = until(lambda: published(domain), "the map")
    assert found.resolution_m == 0.05 and found.width > 50
