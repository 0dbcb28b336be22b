"""A process that uses rclpy, for tests: pytest's own process cannot."""

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pytest

from robots.shared.ros2.environment import MESSAGES, READY, WHEELS, domain_environment, ros_environment
from tests.forked import ROS2, ForkedProgram
from tests.processes import REPOSITORY

PATIENCE_S = 20.0

needs_rclpy = pytest.mark.skipif(not READY.exists(), reason="script/setup ros2 has not installed rclpy")


class Side:
    """One process, and the lines that it prints."""

    def __init__(
        self,
        module: str,
        domain: int,
        *arguments: str,
        environment: Mapping[str, str] | None = None,
        within: Sequence[str] = (),
    ) -> None:
        """`environment`: another search than on this computer; `within`: a command that starts it."""
        given = dict(environment or domain_environment(domain))
        words = [module, *(arguments or [str(domain)])]
        self.process: Any = (
            subprocess.Popen(
                [*within, sys.executable, "-m", *words],
                cwd=REPOSITORY,
                env=os.environ | ros_environment([MESSAGES, WHEELS]) | given,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            if within
            else ForkedProgram(*words, environment=given, forks=ROS2, talks=True)
        )
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self._lines.put(line.decode().strip())
        self._lines.put("ended")

    def await_line(self, begin: str, which: Callable[[list[str]], bool] = lambda words: True) -> list[str]:
        """Return the words of the next such line; others are dropped."""
        until_s = time.monotonic() + PATIENCE_S
        while True:
            words = self._lines.get(timeout=max(until_s - time.monotonic(), 0.0)).split()
            if words[:1] == [begin] and which(words):
                return words
            assert words != ["ended"], f"the process has ended; no such line: {begin}"
            assert time.monotonic() < until_s, f"no such line: {begin}"

    def forget(self) -> None:
        """Drop the lines that have come."""
        while not self._lines.empty():
            self._lines.get()

    def say(self, line: str) -> None:
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def close(self, *, kill: bool = False) -> None:
        """End the process, by itself or at once."""
        self.process.stdin.close()
        if kill:
            self.process.kill()
        self.process.wait(PATIENCE_S)
        self._reader.join(PATIENCE_S)
        self.process.stdout.close()
