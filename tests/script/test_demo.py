"""script/demo as a person starts and ends it."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from benchmarks.parts.proc import children
from script.stack.places import REPOSITORY

PATIENCE_S = 60.0
ENDED_S = 10.0


def until(condition: Callable[[], object], what: str, timeout_s: float) -> None:
    """Poll: what we wait for happens in processes that are not ours."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(0.05)


def family(pid: int) -> list[int]:
    """A process and all that come from it."""
    return [pid, *(relative for child in children(pid) for relative in family(child))]


def alive(pid: int) -> bool:
    """Neither gone nor waiting to be."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def command_line(pid: int) -> str:
    """What it was started as."""
    with suppress(FileNotFoundError):
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").strip()
    return ""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


class Demo:
    """A running demo on a port of its own."""

    def __init__(self, port: int, output: Path) -> None:
        self.port = port
        self.directory = REPOSITORY / "var" / f"demo-{port}"
        self._output = output
        environment = {
            name: value for name, value in os.environ.items() if not name.startswith(("FLEET_", "DJANGO_"))
        }
        with output.open("w") as file:
            self.process = subprocess.Popen(
                ["script/demo", "--port", str(port)],
                cwd=REPOSITORY,
                stdout=file,
                stderr=file,
                env=environment,
            )
        until(
            lambda: "is ready" in self.said or self.process.poll() is not None,
            "the demo is ready",
            PATIENCE_S,
        )
        assert self.process.poll() is None, self.said
        self.family = family(self.process.pid)
        self._commands = {pid: command_line(pid) for pid in self.family}

    @property
    def said(self) -> str:
        return self._output.read_text()

    @property
    def open(self) -> bool:
        """Whether somebody listens on its port."""
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def assert_nothing_left(self) -> None:
        """No process, no port, no socket file."""
        try:
            until(lambda: not any(map(alive, self.family)), "every process has ended", ENDED_S)
        except AssertionError as error:
            left = {pid: self._commands[pid] for pid in self.family if alive(pid)}
            raise AssertionError(f"{error}; left: {left}") from None
        assert not self.open
        assert not list((self.directory / "run").glob("*.sock"))


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """All tests here start the same demo: only the first start has a database to make."""
    number = free_port()
    yield number
    shutil.rmtree(REPOSITORY / "var" / f"demo-{number}")


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[int], Demo]]:
    """Start a demo on a port; what a test leaves running is ended."""
    started: list[Demo] = []

    def start(port: int) -> Demo:
        started.append(Demo(port, tmp_path / f"output-{len(started)}"))
        return started[-1]

    yield start
    for demo in started:
        if demo.process.poll() is None:
            demo.process.terminate()
        demo.process.wait()


def test_the_main_job_works_from_the_command_line():
    done = subprocess.run(["script/demo", "--smoke"], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.search(r"smoke: ready in .* m driven in .* stop pressed, standstill after \d+ ms", done.stdout)


def test_ctrl_c_ends_everything_and_passwords_stay(port: int, start: Callable[[int], Demo]):
    first = start(port)
    passwords = first.directory / "passwords.txt"
    assert passwords.stat().st_mode & 0o777 == 0o600
    kept = passwords.read_text()
    first.process.send_signal(signal.SIGINT)
    assert first.process.wait(ENDED_S) == 0
    first.assert_nothing_left()

    second = start(port)
    assert passwords.read_text() == kept
    assert all(line.split()[1] in second.said for line in kept.splitlines())
    second.process.send_signal(signal.SIGHUP)  # as a closed terminal does
    assert second.process.wait(ENDED_S) == 0
    second.assert_nothing_left()


def test_nothing_outlives_a_demo_that_is_killed(port: int, start: Callable[[int], Demo]):
    demo = start(port)
    assert len(demo.family) > 10  # three masters, three simulators, three bridges, supervisor, web process
    demo.process.kill()
    demo.process.wait()
    demo.assert_nothing_left()


def test_a_part_that_dies_is_named_and_ends_the_demo(port: int, start: Callable[[int], Demo]):
    demo = start(port)
    [web] = [pid for pid in demo.family if "daphne" in Path(f"/proc/{pid}/cmdline").read_text()]
    os.kill(web, signal.SIGKILL)
    assert demo.process.wait(ENDED_S) == 1
    assert "web was ended by SIGKILL" in demo.said
    demo.assert_nothing_left()


def test_a_second_demo_takes_another_port_and_never_the_same(port: int, start: Callable[[int], Demo]):
    demo = start(port)
    other = subprocess.run(
        ["script/demo", "--port", str(port)], cwd=REPOSITORY, capture_output=True, text=True, timeout=ENDED_S
    )
    assert other.returncode == 1
    assert f"Cannot listen on port {port}" in other.stderr
    assert demo.open
