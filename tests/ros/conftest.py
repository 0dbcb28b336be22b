"""Fixtures for tests against a real rosmaster and simulated robots. See `tests.ros.support`."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from std_msgs.msg import String

from tests.forked import end_forks
from tests.ros.support import Master, RosClient, SimulatorProcess


@pytest.fixture(scope="session")
def rosmaster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    """The rosmaster of this test process."""
    master = Master(tmp_path_factory.mktemp("ros")).start()
    yield master
    master.stop()
    end_forks()


@pytest.fixture(scope="session")
def ros(rosmaster: Master) -> Iterator[RosClient]:
    """The ROS node of this test process at `rosmaster`."""
    client = RosClient(rosmaster)
    yield client
    client.close()


@pytest.fixture
def fault(ros: RosClient) -> Iterator[Callable[[str], None]]:
    """``fault(names)`` sets the simulated robot's faults (robots/simulator/faults.py) until the end of the test."""
    with (
        ros.listen("/ground_truth/faults", String) as faults,
        ros.speak("/ground_truth/fault", String) as setter,
    ):

        def begin(names: str) -> None:
            setter.publish(String(names))
            faults.until(lambda message: message.data == names)

        yield begin
        begin("none")


@pytest.fixture(scope="module")
def make_master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], Master]]:
    """Start more masters, for more robots or to kill them. They end after the module."""
    started: list[Master] = []

    def make() -> Master:
        started.append(Master(tmp_path_factory.mktemp("master")).start())
        return started[-1]

    yield make
    for master in started:
        master.stop()


@pytest.fixture(scope="module")
def simulator(
    rosmaster: Master, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., SimulatorProcess]]:
    """Start simulated robots: ``simulator(pose="2,2,0", seed=1)``. They end after the module.

    Two robots need two masters (``simulator(master=make_master())``): their topics have the same names.
    """
    started: list[SimulatorProcess] = []
    folder = tmp_path_factory.mktemp("simulator")
    numbers = itertools.count(1)

    def start(master: Master = rosmaster, **options: Any) -> SimulatorProcess:
        name = options.pop("name", f"tiago-{next(numbers)}")
        process = SimulatorProcess(master, folder / f"{name}.log", name, **options)
        started.append(process)
        return process.wait_ready()

    yield start
    for process in started:
        process.stop()
