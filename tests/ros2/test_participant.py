"""A process in a domain: what strangers can do to it."""

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
    finally:
        side.close()


def test_all_that_came_during_a_rest_is_read_before_the_next_one(domain: int) -> None:
    side = Side("tests.ros2.rests_side", domain)
    try:
        assert side.await_line("read") == ["read", "8"]
    finally:
        side.close()
