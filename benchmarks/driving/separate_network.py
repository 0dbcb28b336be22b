"""A robot in a separate network, connected to the console's network by a cable that can be pulled out.

Uses Linux network namespaces without privileges: the caller has to run inside

    unshare --user --map-root-user --net
"""

from __future__ import annotations

import subprocess
import time
from dataclasses import replace
from pathlib import Path

from script.stack.stack import PRACTICE_ROBOTS, PracticeRobot

UNSHARE = ("unshare", "--user", "--map-root-user", "--net", "--")
CONSOLE_ADDRESS = "10.99.0.1"
ROBOT_ADDRESS = "10.99.0.2"


class RobotApart:
    """Context: the robot's network and the cable to it."""

    def __enter__(self) -> RobotApart:
        # A network namespace exists only while a process is in it.
        self._resident = subprocess.Popen(["unshare", "--net", "--", "sleep", "infinity"])  # noqa: S607
        self._wait_until_apart()
        pid = str(self._resident.pid)
        self._inside = ("nsenter", "--target", pid, "--net", "--")
        _ip("link", "set", "lo", "up")
        _ip("link", "add", "console", "type", "veth", "peer", "name", "robot", "netns", pid)
        _ip("address", "add", f"{CONSOLE_ADDRESS}/30", "dev", "console")
        _ip("link", "set", "console", "up")
        _ip("address", "add", f"{ROBOT_ADDRESS}/30", "dev", "robot", inside=self._inside)
        _ip("link", "set", "lo", "up", inside=self._inside)
        self.join()
        return self

    def __exit__(self, *_: object) -> None:
        self._resident.kill()
        self._resident.wait()

    @property
    def plan(self) -> PracticeRobot:
        """Return the first simulated robot, moved into this network."""
        return replace(
            PRACTICE_ROBOTS[0], address=ROBOT_ADDRESS, console_address=CONSOLE_ADDRESS, inside=self._inside
        )

    def cut(self) -> None:
        """Pull the cable out: bytes are lost, and neither side notices."""
        _ip("link", "set", "robot", "down", inside=self._inside)

    def join(self) -> None:
        """Plug the cable in, and wait until both ends carry: a program that starts before does not see its network."""
        _ip("link", "set", "robot", "up", inside=self._inside)
        for name, inside in (("console", ()), ("robot", self._inside)):
            while "state UP" not in _ip("-o", "link", "show", name, inside=inside):
                time.sleep(0.01)

    def _wait_until_apart(self) -> None:
        ours = Path("/proc/self/ns/net").readlink()
        while Path(f"/proc/{self._resident.pid}/ns/net").readlink() == ours:
            time.sleep(0.01)


def _ip(*words: str, inside: tuple[str, ...] = ()) -> str:
    return subprocess.run([*inside, "ip", *words], check=True, stdout=subprocess.PIPE, text=True).stdout  # noqa: S603
