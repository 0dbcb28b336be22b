"""A console with a robot of ROS 2: what `script/demo --mixed --smoke` does."""

import asyncio

from script.stack.smoke import drive_and_stop
from script.stack.stack import MIXED_ROBOTS, temporary_stack
from tests.ros2.side import needs_rclpy

pytestmark = needs_rclpy


def test_a_person_drives_it_a_metre_and_stops_it() -> None:
    robot = next(robot for robot in MIXED_ROBOTS if robot.ros == 2)
    with temporary_stack([robot]) as stack:
        assert "stop pressed" in asyncio.run(drive_and_stop(stack, robot.slug))
