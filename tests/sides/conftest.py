"""Fixtures for tests that run against a robot of each ROS. `docs/development.md` shows their use."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from robots.shared.configuration.bridge_config import BridgeConfig
from tests.forked import end_forks
from tests.processes import end, until
from tests.ros.bridge_support import BridgeProcess, Hand, WatchdogProcess, drivable
from tests.ros.support import simulator_words
from tests.sides.side import SIDES, Side, running_side
from tests.sides.visitor import Visitor


@pytest.fixture(scope="session")
def forks() -> Iterator[None]:
    yield
    end_forks()


@pytest.fixture(scope="module", params=SIDES)
def side(
    request: pytest.FixtureRequest, forks: None, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Side]:
    """A network of ROS 1, then one of ROS 2: all tests of a module run with each."""
    with running_side(request.param, tmp_path_factory.mktemp("side")) as side:
        yield side


@pytest.fixture(scope="module")
def simulator(side: Side, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Any]]:
    """Start simulated robots: ``simulator(pose="2,2,0", seed=1)``; ``simulator(on=side)`` on another network."""
    folder, numbers = tmp_path_factory.mktemp("simulator"), itertools.count(1)
    with ExitStack() as ending:

        def start(on: Side = side, **options: Any) -> Any:
            name = f"tiago-{next(numbers)}"
            log = folder / f"{name}.log"
            program = on.fork(*simulator_words(name, ros=on.number, **options), log=log)
            ending.callback(program.stdin.close)
            ending.callback(end, program)
            until(lambda: " is up " in log.read_text() or program.poll() is not None, "a simulated robot")
            assert program.poll() is None, log.read_text()
            return program

        yield start


@pytest.fixture(scope="module")
def robot(simulator: Callable[..., Any]) -> Any:
    """The module's simulated robot, in the office."""
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture(scope="module")
def visitor(side: Side, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visitor]:
    """A node beside the robot."""
    with closing(Visitor(side, tmp_path_factory.mktemp("visitor"))) as visitor:
        yield visitor


@pytest.fixture
def fault(robot: Any, visitor: Visitor) -> Iterator[Callable[[str], None]]:
    """``fault(names)`` sets the simulated robot's faults (robots/simulator/faults.py) until the end of the test."""
    with (
        visitor.listen("/ground_truth/faults", "std_msgs/String", kept=True) as faults,
        visitor.speak("/ground_truth/fault", "std_msgs/String") as setter,
    ):

        def begin(names: str) -> None:
            setter.publish(data=names)
            faults.until(lambda message: message.data == names)

        yield begin
        begin("none")


@pytest.fixture
def config(side: Side, tmp_path: Path) -> BridgeConfig:
    """The robot's configuration. A module that needs more parts has a fixture of this name."""
    return side.config(tmp_path)


@pytest.fixture
def start(side: Side, robot: Any, config: BridgeConfig, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Start this robot's `BridgeProcess` or `WatchdogProcess`, also with another configuration."""
    with ExitStack() as ending:

        def begin(kind: Any, changed: BridgeConfig = config) -> Any:
            process = kind(changed, side, tmp_path)
            ending.callback(process.stop)
            return process

        yield begin


@pytest.fixture
def watchdog(start: Callable[..., Any]) -> WatchdogProcess:
    return start(WatchdogProcess).ready()


@pytest.fixture
def bridge(start: Callable[..., Any]) -> BridgeProcess:
    return start(BridgeProcess)


@pytest.fixture
def hand(bridge: BridgeProcess) -> Iterator[Hand]:
    """The holder of control of a robot that can be driven."""
    with closing(bridge.link()) as hand:
        hand.state_until(drivable, "the robot to be online")
        hand.take_control(1)
        yield hand
