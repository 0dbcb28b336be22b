"""Attacks of a domain's strangers on parts of the console: their servers, types, QoS, floods."""

from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.ros2.environment import domain_environment
from tests.forked import ROS2, answer_of
from tests.ros2.conftest import free_domain
from tests.ros2.side import Side, needs_rclpy

pytestmark = needs_rclpy
GROWN_MB = 100


@pytest.fixture
def domain() -> Iterator[int]:
    """A domain for each test: who died without a word stays in it for 20 s."""
    with free_domain() as found:
        yield found


@contextmanager
def stranger(domain: int, *role: str) -> Iterator[Side]:
    """A stranger that has begun."""
    side = Side("tests.ros2.hostile.stranger", domain, *role)
    try:
        side.await_line("done")
        yield side
    finally:
        side.close(kill=True)


@contextmanager
def scenario(domain: int, *name: str) -> Iterator[Side]:
    side = Side("tests.ros2.hostile.domain_side", domain, *name)
    try:
        yield side
    finally:
        side.close(kill=True)


def test_goals_end_with_their_server_and_only_once(domain: int) -> None:
    """A server never answers, and another one takes its place; that one answers twice; the result of one is lost.

    That one's goal does not end by the word of a stranger.
    """
    with scenario(domain, "actions") as side:
        side.await_line("runs")
        assert side.await_line("forgotten") == ["forgotten"]
        assert side.await_line("ended") == ["ended", "second", "third"]
        assert side.await_line("runs") == ["runs", "fourth", "[]"]
        assert side.await_line("ended") == ["ended", "second", "third", "fourth"]
        side.await_line("cancelled")


def test_no_message_waits_where_they_are_counted(domain: int) -> None:
    with scenario(domain, "often") as side:
        assert side.await_line("slept") == ["slept", "2"]
        assert side.await_line("slept") == ["slept", "0"]


def test_another_version_of_a_type_is_named_and_not_read(domain: int) -> None:
    """DDS connects the two, and the field in front would be read for the one that is known."""
    with scenario(domain, "versions") as side:
        said = " ".join(side.await_line("said"))
        assert "/words: std_msgs/msg/String has other fields at /newer than here" in said
        assert side.await_line("heard") == ["heard", "0"]
        assert side.await_line("heard") == ["heard", "000100000400000061626300"]


def test_publishers_may_change_what_they_offer(domain: int) -> None:
    with scenario(domain, "qos") as side:
        for words in (["sure"], ["fast"], ["sure", "again"], ["kept"]):
            assert side.await_line("heard") == ["heard", *words]


def test_further_listeners_take_no_velocities_away_from_the_robot(domain: int) -> None:
    """One of another type, and a crowd in which the robot cannot be found."""
    with scenario(domain, "kinds") as side:
        for _ in range(2):
            assert side.await_line("kind") == ["kind", "geometry_msgs/msg/TwistStamped"]
        assert side.await_line("there") == ["there", "True"]
        side.await_line("over")


def test_listeners_that_dds_does_not_connect_hide_no_robot(domain: int) -> None:
    with scenario(domain, "unfit") as side:
        for _ in range(2):
            assert side.await_line("listeners") == ["listeners", "1"]


def test_a_stop_cancels_goals_of_so_many_servers_and_no_more(domain: int) -> None:
    """The first servers stay; names that nobody serves, and another robot's namespace, take no place."""
    with scenario(domain, "servers") as side:
        assert side.await_line("found")[:2] == ["found", "129"]
        assert side.await_line("stay") == ["stay", "True"]
        assert side.await_line("left") == ["left", "False"]


def test_a_slow_look_at_actions_delays_no_zero_on_a_new_topic(domain: int) -> None:
    with scenario(domain, "slow") as side:
        assert side.await_line("heard") == ["heard", "0.0"]


def test_thousands_of_publishers_are_not_looked_at(domain: int) -> None:
    with scenario(domain, "crowd") as side:
        assert side.await_line("looked") == ["looked"]


def test_a_switch_of_types_waits_for_standstill_and_loses_no_stop(domain: int) -> None:
    with scenario(domain, "switch") as side:
        assert side.await_line("driven") == ["driven", "geometry_msgs/msg/Twist"]
        assert side.await_line("heard") == ["heard", "0.5", "0.25"]
        assert side.await_line("stands") == ["stands", "geometry_msgs/msg/TwistStamped"]
        by_each = ["0.5", "0.25", "0.0"], ["0.0", "0.0"]  # a zero with each of the two stamps
        assert side.await_line("heard") == ["heard", *by_each[0], *by_each[1]]


def test_a_flood_of_large_messages_does_not_fill_a_slow_reader(domain: int) -> None:
    with stranger(domain, "strings", "3000000"), scenario(domain, "flood", "3") as side:
        assert int(side.await_line("grown")[1]) < GROWN_MB


@pytest.mark.parametrize("side", [4200, 10_000], ids=["18 MB", "100 MB"])
def test_a_map_that_is_too_large_is_named(domain: int, side: int) -> None:
    wanted = MapWanted(Ros2(domain, "localhost"), Topic("/map", "nav_msgs/msg/OccupancyGrid"))
    with stranger(domain, "huge_map", str(side)):
        question, environment = msgspec.json.encode(wanted), domain_environment(domain)
        answer = answer_of("robots.bridge.ros2.sensors.map", question, environment, ROS2)
    assert msgspec.msgpack.decode(answer, type=NoMap).why == f"/huge_map: it has {side} x {side} cells"
