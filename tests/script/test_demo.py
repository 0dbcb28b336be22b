"""script/demo as a person starts and ends it."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from script.stack.places import REPOSITORY
from tests.script.support import ENDED_S, Family, free_port, listens, outside, until

PATIENCE_S = 60.0


class Demo:
    """A running demo on a port of its own."""

    def __init__(self, port: int, output: Path) -> None:
        self.port = port
        self.directory = REPOSITORY / "var" / f"demo-{port}"
        self._output = output
        with output.open("w") as file:
            self.process = subprocess.Popen(
                ["script/demo", "--port", str(port)],
                cwd=REPOSITORY,
                stdout=file,
                stderr=file,
                env=outside(),
            )
        until(
            lambda: "is ready" in self.said or self.process.poll() is not None,
            "the demo is ready",
            PATIENCE_S,
        )
        assert self.process.poll() is None, self.said
        self.family = Family(self.process.pid)

    @property
    def said(self) -> str:
        return self._output.read_text()

    def assert_nothing_left(self) -> None:
        """No process, no port, no socket file."""
        self.family.assert_gone()
        assert not listens(self.port)
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
    os.kill(demo.family.named("daphne"), signal.SIGKILL)
    assert demo.process.wait(ENDED_S) == 1
    assert "web was ended by SIGKILL" in demo.said
    demo.assert_nothing_left()


def test_a_second_demo_takes_another_port_and_never_the_same(port: int, start: Callable[[int], Demo]):
    start(port)
    other = subprocess.run(
        ["script/demo", "--port", str(port)], cwd=REPOSITORY, capture_output=True, text=True, timeout=ENDED_S
    )
    assert other.returncode == 1
    assert f"Cannot listen on port {port}" in other.stderr
    assert listens(port)
