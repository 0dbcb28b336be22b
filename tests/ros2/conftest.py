"""A domain of ROS 2 for each test module, also while other tests run on this computer."""

import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from script.stack.processes import ReservedDomain
from tests.forked import end_forks


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
def short_folder() -> Iterator[Path]:
    """A folder with a short name, because the length of a socket's path is limited."""
    with tempfile.TemporaryDirectory(prefix="fleet-test-") as folder:
        yield Path(folder)
