"""A process in a domain: what strangers can do to it."""

from pathlib import Path

import pytest

from robots.shared.ros2.environment import domain_environment
from tests.ros2.side import Side, needs_rclpy

pytestmark = needs_rclpy


def test_unreadable_answers_end_nothing_and_two_servers_are_not_asked(domain: int) -> None:
    side = Side("tests.ros2.participant_side", domain)
    try:
        assert side.await_line("heard") == ["heard", "True"]
        assert side.await_line("answered") == ["answered", "True"]
        assert side.await_line("asked") == ["asked", "True"]
        assert side.await_line("asked") == ["asked", "False"]
        assert side.await_line("services") == ["services", "/list"]  # none that a stranger could call
        parameters = {"use_sim_time", "start_type_description_service"}  # rclpy's own
        assert {*side.await_line("parameters")[1:]} == parameters
        assert side.await_line("slow") == ["slow", "True"]  # patience counts from the request
    finally:
        side.close()


def test_all_that_came_during_a_rest_is_read_before_the_next_one(domain: int) -> None:
    side = Side("tests.ros2.rests_side", domain)
    try:
        assert side.await_line("read") == ["read", "8"]
    finally:
        side.close()


@pytest.mark.parametrize("peers", [(), ("127.0.0.1",)])
def test_nodes_speak_by_udp_and_keep_nothing_in_shared_memory(domain: int, peers: tuple[str, ...]) -> None:
    """There, files of dead processes and of other people would stand in the way."""
    environment = domain_environment(domain, "localhost", peers)
    sides = [
        Side("tests.ros2.many_nodes", domain, role, "1", environment=environment)
        for role in ("robot", "console")
    ]
    try:
        for side, line in zip(sides, ("up", "found"), strict=True):
            side.await_line(line)
        assert "/fastdds_" not in Path(f"/proc/{sides[0].process.pid}/maps").read_text()
    finally:
        for side in sides:
            side.close()
