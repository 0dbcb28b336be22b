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
from contextlib import ExitStack, suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO
from unittest.mock import patch

from robots.shared.configuration.robot_ros import Ros, Ros2
from robots.shared.ros2.environment import MESSAGES, WHEELS, ros_environment
from robots.shared.ros2.importing import make_importable
from tests.processes import PATIENCE_S, REPOSITORY

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


def forks_of(ros: Ros) -> Forks:
    return ROS2 if isinstance(ros, Ros2) else ROS1


class ForkedProgram:
    """A process that runs `program`, like `subprocess.Popen`: a module, or the path of a file.

    `stdin` is the writing end of its standard input. What it prints is appended to the file `log`, without a log to
    what the tests print; if it `talks`, its output comes out of `stdout`. Its environment is that of the tests, with
    changes.
    """

    def __init__(
        self,
        program: str,
        *arguments: str,
        log: Path | None = None,
        environment: Mapping[str, str],
        forks: Forks = ROS1,
        talks: bool = False,
    ) -> None:
        self.args = [program, *arguments]
        if log is not None:
            log.touch()
        with ExitStack() as theirs:
            stdin, ours = _context.Pipe(duplex=False)
            theirs.enter_context(stdin)
            self.stdin = _file(ours, "wb")
            stdout = None
            if talks:
                ours, stdout = _context.Pipe(duplex=False)
                theirs.enter_context(stdout)
                self.stdout = _file(ours, "rb")
            task = (self.args, log, dict(environment), stdin, stdout)
            self._process = _context.Process(target=_run, args=task, daemon=True)
            forks.start(self._process)
        assert self._process.pid is not None
        self.pid: int = self._process.pid

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit code; None while the process runs."""
        if self.returncode is not None:
            with suppress(BrokenPipeError):
                self.stdin.close()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end and return the exit code; raise `subprocess.TimeoutExpired`."""
        self._process.join(timeout)
        if (code := self.poll()) is None:
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


def answer_of(program: str, question: bytes, environment: Mapping[str, str], forks: Forks) -> bytes:
    """Run a program that reads a question to its end, prints the answer and ends well; return the answer."""
    process = ForkedProgram(program, environment=environment, forks=forks, talks=True)
    with process.stdout, process.stdin:
        process.stdin.write(question)
        process.stdin.close()
        answer = process.stdout.read()
    assert process.wait(PATIENCE_S) == 0
    return answer


def end_forks() -> None:
    """End all forks and the processes that make them. Then their computing time counts as this process's."""
    for left in multiprocessing.active_children():
        left.kill()
        left.join()
    for forks in (ROS1, ROS2):
        forks.stop()


def _file(end: Connection, mode: str) -> IO[bytes]:
    """Return an end of a pipe as a file."""
    with end:
        return os.fdopen(os.dup(end.fileno()), mode)


def _run(
    args: list[str],
    log: Path | None,
    environment: dict[str, str],
    stdin: Connection,
    stdout: Connection | None,
) -> None:
    """Become the program; this runs in the fork."""
    # The end of the tests ends the process that makes forks, which ends its forks. So none may hold its life line.
    ctypes.CDLL(None).prctl(SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    os.chdir(REPOSITORY)
    os.environ.update(environment)
    make_importable()  # the library has set Python's path to that of the tests
    if log is not None:
        with log.open("ab") as output:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
    for given, number in ((stdin, 0), (stdout, 1)):
        if given is not None:
            os.dup2(given.fileno(), number)
            given.close()
    sys.stdin, sys.argv = os.fdopen(0), args
    try:
        if os.sep in args[0]:
            runpy.run_path(args[0], run_name="__main__")
        else:
            runpy.run_module(args[0], run_name="__main__", alter_sys=True)
    finally:  # as at the end of an interpreter, which multiprocessing leaves out
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
