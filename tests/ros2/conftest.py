"""A domain of ROS 2 for each test module, also while other tests run on this computer."""

import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from script.stack.processes import ReservedDomain
from tests.forked import end_forks
from tests.ros2.side import Side
from tests.sides.side import Ros2Side
from tests.sides.visitor import Visitor

OPTIONS = ("--ros=2", "--name=tiago-9", "--pose=2,1.8,0", "--seed=1", "--drift=0", "--exit-with-parent")


@contextmanager
def free_domain() -> Iterator[int]:
    """A domain that no other test uses."""
    with closing(ReservedDomain()) as reserved:
        yield reserved.number


@pytest.fixture(scope="session", autouse=True)
def forks() -> Iterator[None]:
    yield
    end_forks()


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    with free_domain() as found:
        yield found


@pytest.fixture(scope="module")
def network(domain: int) -> Ros2Side:
    """The domain, as the tests of both ROS know a robot's network."""
    return Ros2Side(domain)


@pytest.fixture(scope="module")
def robot(domain: int) -> Iterator[Side]:
    """A simulated robot in the office."""
    with closing(Side("robots.simulator", domain, *OPTIONS)) as robot:
        yield robot


@pytest.fixture(scope="module")
def visitor(network: Ros2Side, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visitor]:
    """A node beside the robot."""
    with closing(Visitor(network, tmp_path_factory.mktemp("visitor"))) as visitor:
        yield visitor


@pytest.fixture(scope="module")
def short_folder() -> Iterator[Path]:
    """A folder with a short name, because the length of a socket's path is limited."""
    with tempfile.TemporaryDirectory(prefix="fleet-test-") as folder:
        yield Path(folder)
