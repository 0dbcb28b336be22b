"""Helpers for tests of started programs: their processes, their ports, and a short drive."""

from __future__ import annotations

import math
import socket
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

from benchmarks.parts.process_stats import children
from script.stack.client import Driver
from script.stack.places import REPOSITORY
from script.stack.stack import Stack
from tests.processes import until

ENDED_S = 30.0


def listens(port: int) -> bool:
    """Return whether a server listens on this port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def command_line(pid: int) -> str:
    """Return the command line of a process, "" if it has ended."""
    with suppress(FileNotFoundError):
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").strip()
    return ""


class Family:
    """A process and its current descendants."""

    def __init__(self, pid: int) -> None:
        self.commands = {member: command_line(member) for member in _descent(pid)}

    def __len__(self) -> int:
        return len(self.commands)

    def named(self, words: str) -> int:
        """Return the id of the one process whose command line contains these words."""
        [pid] = [pid for pid, command in self.commands.items() if words in command]
        return pid

    def assert_gone(self) -> None:
        """Wait until all processes of the family have ended."""
        try:
            until(lambda: not any(map(_alive, self.commands)), "every process has ended", ENDED_S)
        except AssertionError as error:
            left = {pid: command for pid, command in self.commands.items() if _alive(pid)}
            raise AssertionError(f"{error}; left: {left}") from None


def _descent(pid: int) -> list[int]:
    return [pid, *(relative for child in children(pid) for relative in _descent(child))]


def _alive(pid: int) -> bool:
    """Return whether the process runs; False also for a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


async def drive_forward(driver: Driver) -> None:
    """Hold full stick until the robot has driven 0.1 m by odometry."""
    start = driver.odometry
    assert start

    def driven_m() -> float:
        now = driver.odometry
        return math.hypot(now.x - start.x, now.y - start.y) if now else 0.0

    await driver.hold_stick(1.0, 0.0, lambda: driven_m() > 0.1)


def manage(stack: Stack, *words: str) -> str:
    """Run a command of `manage.py` in the stack to its end; return the printed text."""
    done = subprocess.run(
        [sys.executable, "manage.py", *words],
        cwd=REPOSITORY,
        env=stack.environment,
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout.strip()


_MAKE_TOKENS = """import sys
from django.core.management import call_command
from django.db import connections
for line in sys.stdin:
    call_command("make_token", *line.split())
    connections.close_all()
"""


@cache
def token(stack: Stack, role: str, *scopes: str, name: str = "night-tests") -> str:
    """Return a token of one of the stack's people; the same one each time, as a person may have few."""
    maker = _token_maker(stack)
    assert maker.stdin and maker.stdout
    print(stack.accounts[role].username, name, *scopes, file=maker.stdin, flush=True)
    text = maker.stdout.readline().strip()
    assert text, "make_token failed"
    return text


@cache
def _token_maker(stack: Stack) -> subprocess.Popen[str]:
    """Start a process that makes all tokens of a stack: each start of `manage.py` takes a second of computing.

    It ends with this process.
    """
    return subprocess.Popen(
        [sys.executable, "manage.py", "shell", "--no-imports", "-c", _MAKE_TOKENS],
        cwd=REPOSITORY,
        env=stack.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
