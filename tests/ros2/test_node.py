"""The bridge’s rclpy node against a robot’s base, each in a process and both in a domain of their own."""

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import pytest

from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from tests.processes import REPOSITORY

PATIENCE_S = 20.0
RUN = 7  # place of the run in a line about odometry

pytestmark = pytest.mark.skipif(
    not (MESSAGES / "ready").exists(), reason="script/setup ros2 has not installed rclpy"
)


class Side:
    """One process, and the lines that it prints."""

    def __init__(self, module: str, domain: int) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, str(domain)],
            cwd=REPOSITORY,
            env=os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(domain),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.strip())

    def await_line(self, begin: str, which: Callable[[list[str]], bool] = lambda words: True) -> list[str]:
        """Return the words of the next such line; others are dropped."""
        until_s = time.monotonic() + PATIENCE_S
        while True:
            words = self._lines.get(timeout=max(until_s - time.monotonic(), 0.0)).split()
            if words[0] == begin and which(words):
                return words
            assert time.monotonic() < until_s, f"no such line: {begin}"

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def close(self, *, kill: bool = False) -> None:
        """End the process, by itself or at once."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        if kill:
            self.process.kill()
        self.process.wait(PATIENCE_S)
        self._reader.join(PATIENCE_S)
        self.process.stdout.close()


@pytest.fixture
def domain() -> int:
    return 1 + os.getpid() % 100  # ports of higher domains are those of outgoing connections


@pytest.fixture
def robot(domain: int):
    side = Side("tests.ros2.robot_side", domain)
    yield side
    side.close()


@pytest.fixture
def bridge(domain: int, robot: Side):
    side = Side("tests.ros2.bridge_side", domain)
    yield side
    side.close()


def test_core_gets_odometry_and_scans(bridge: Side) -> None:
    assert bridge.await_line("odometry")[1:] == ["1.5", "0.0", "0.0", "0.25", "0.0", "-0.5", "1", "True"]
    assert bridge.await_line("scan")[1:] == ["/scan_raw", "1.0", "2.0", "inf", "4.0", "5.0", "-1.0", "10.0"]


def test_twists_and_cancels_reach_the_robot(bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    bridge.say("0.5 -0.25")
    assert robot.await_line("twist") == ["twist", "0.5", "-0.25"]
    bridge.say("cancel")
    assert robot.await_line("cancel") == ["cancel", "all"]


def test_a_bridge_that_ends_leaves_zero(bridge: Side, robot: Side) -> None:
    bridge.await_line("listened")
    bridge.say("0.5 0.0")
    robot.await_line("twist")
    bridge.close()
    assert robot.await_line("twist") == ["twist", "0.0", "0.0"]
    assert bridge.await_line("left") == ["left", "True"]


def test_another_run_of_the_robot_is_another_run(domain: int, bridge: Side, robot: Side) -> None:
    before = bridge.await_line("odometry")[RUN]
    robot.close(kill=True)
    again = Side("tests.ros2.robot_side", domain)
    try:
        bridge.await_line("odometry", lambda words: words[RUN] != before)
    finally:
        again.close()
