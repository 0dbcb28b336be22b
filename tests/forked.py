"""Starts Python programs without importing their modules again: as forks of a process that has them loaded.

A test process starts dozens of bridges, simulators and masters. Each would import rospy, numpy and MuJoCo, which
takes most of its computing time. A fork has its own memory and files, like any other process. A missing import of a
program shows only where its command is started: in `tests/script` and `tests/ros/test_run_fleet.py`.

Each ROS has such a process of its own: both have packages of the same names.
"""

from __future__ import annotations

import atexit
import ctypes
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from pathlib import Path
from unittest.mock import patch

from robots.shared.ros2.environment import MESSAGES, WHEELS, ros_environment
from robots.shared.ros2.importing import make_importable
from tests.processes import REPOSITORY

SIGNAL_OF_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG of prctl(2)
_context = multiprocessing.get_context("forkserver")


class Forks:
    """A process that has modules loaded, in an environment of its own. It starts with the first program."""

    def __init__(self, environment: Mapping[str, str], *loaded: str) -> None:
        self._environment = environment
        self._server = forkserver.ForkServer()
        self._server.set_forkserver_preload([*loaded])

    def start(self, process: multiprocessing.process.BaseProcess) -> None:
        """Start it as a fork. The library knows one such process for all programs."""
        connect = self._server.connect_to_new_process
        with (
            patch.dict(os.environ, self._environment),
            patch.object(forkserver, "connect_to_new_process", connect),
        ):
            process.start()

    def stop(self) -> None:
        self._server._stop()  # type: ignore[attr-defined]


_BOTH = ("robots.bridge.process", "robots.bridge.watchdog.process", "robots.simulator.worlds")
# Not "rosmaster": it keeps the arguments of the process that loads it.
ROS1 = Forks(
    {},
    "robots.bridge.ros",  # first: it makes rospy importable
    *_BOTH,
    "robots.simulator.ros.process",
)
ROS2 = Forks(
    ros_environment([MESSAGES, WHEELS]),
    "robots.bridge.ros2",  # first: it makes rclpy importable
    *_BOTH,
    "robots.bridge.ros2.node",
    "robots.bridge.ros2.watchdog",
    "robots.simulator.ros2.process",
)


class ForkedProgram:
    """A process that runs `program`, like `subprocess.Popen`: a module, or the path of a file.

    `stdin` is the writing end of its standard input. Its output is appended to the file `log`. Its environment is
    that of the tests, with changes.
    """

    def __init__(
        self, program: str, *arguments: str, log: Path, environment: Mapping[str, str], forks: Forks = ROS1
    ) -> None:
        self.args = [program, *arguments]
        log.touch()
        reading, self.stdin = _context.Pipe(duplex=False)
        with reading:
            task = (self.args, str(log), dict(environment), reading)
            self._process = _context.Process(target=_run, args=task, daemon=True)
            forks.start(self._process)
        assert self._process.pid is not None
        self.pid: int = self._process.pid

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit code; None while the process runs."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end and return the exit code; raise `subprocess.TimeoutExpired`."""
        self._process.join(timeout)
        if (code := self.returncode) is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the process has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def end_forks() -> None:
    """End all forks and the processes that make them. Then their computing time counts as this process's."""
    for left in multiprocessing.active_children():
        left.kill()
        left.join()
    for forks in (ROS1, ROS2):
        forks.stop()


def _run(args: list[str], log: str, environment: dict[str, str], stdin: Connection) -> None:
    """Become the program; this runs in the fork."""
    # The end of the tests ends the process that makes forks, which ends its forks. So none may hold its life line.
    ctypes.CDLL(None).prctl(SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    os.chdir(REPOSITORY)
    os.environ.update(environment)
    make_importable()  # the library has set Python's path to that of the tests
    with open(log, "ab") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    os.dup2(stdin.fileno(), 0)
    stdin.close()
    sys.stdin, sys.argv = os.fdopen(0), args
    try:
        if os.sep in args[0]:
            runpy.run_path(args[0], run_name="__main__")
        else:
            runpy.run_module(args[0], run_name="__main__", alter_sys=True)
    finally:  # as at the end of an interpreter, which multiprocessing leaves out
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
