"""Messages of each type that rclpy has are read and written as rclpy does."""

import os
import subprocess
import sys

from robots.shared.ros2.environment import MESSAGES, WHEELS, ros_environment
from tests.processes import REPOSITORY
from tests.ros2.side import needs_rclpy

LEAST_TYPES = 200

pytestmark = needs_rclpy


def test_each_type_is_read_and_written_as_rclpy_does() -> None:
    tried = subprocess.run(
        [sys.executable, "-m", "tests.ros2.serialized", str(os.getpid())],
        cwd=REPOSITORY,
        env=os.environ | ros_environment([MESSAGES, WHEELS]),
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    *differ, last = tried.stdout.splitlines()
    assert differ == []
    assert int(last.removeprefix("tried ")) >= LEAST_TYPES
