"""Starts Python programs without their imports: forks of a server process that has the modules loaded.

A test process starts dozens of bridges, simulators and masters. Each would import rospy, numpy and MuJoCo again,
which is most of its computing time. Memory and files are not shared: a fork has its own copies.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Mapping
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from pathlib import Path

# Not "rosmaster": it keeps the arguments of the process that loads it.
LOADED = (
    "robots.bridge.ros",  # first: it makes rospy importable
    "robots.bridge.process",
    "robots.bridge.watchdog.process",
    "robots.simulator.ros.process",
    "robots.simulator.worlds",
)
_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload([*LOADED])


class ForkedProgram:
    """A process that runs `program`, like `subprocess.Popen`: a module, or the path of a file.

    `stdin` is the writing end of its standard input. Its output is appended to the file `log`.
    """

    def __init__(self, program: str, *arguments: str, log: Path, environment: Mapping[str, str]) -> None:
        self.args = [program, *arguments]
        log.touch()
        reading, self.stdin = _context.Pipe(duplex=False)
        with reading:
            task = (self.args, str(log), dict(environment), reading)
            self._process = _context.Process(target=_run, args=task, daemon=True)
            self._process.start()
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
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def end_server() -> None:
    """End the server process, so that its computing time counts as this process's."""
    forkserver._forkserver._stop()  # type: ignore[attr-defined]


def _run(args: list[str], log: str, environment: dict[str, str], stdin: Connection) -> None:
    """Become the program; this runs in the fork."""
    os.environ.clear()
    os.environ.update(environment)
    with open(log, "ab") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    os.dup2(stdin.fileno(), 0)
    stdin.close()
    sys.stdin, sys.argv = os.fdopen(0), args
    if os.sep in args[0]:
        runpy.run_path(args[0], run_name="__main__")
    else:
        runpy.run_module(args[0], run_name="__main__", alter_sys=True)
