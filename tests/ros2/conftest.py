"""A domain of DDS for each test module, also while other tests run on this computer."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

DOMAINS = 100  # ports of higher domains are those of outgoing connections


@contextmanager
def free_domain() -> Iterator[int]:
    """A domain that no other test uses."""
    for number in range(os.getpid(), os.getpid() + DOMAINS):
        found = 1 + number % DOMAINS
        lock_file = Path(tempfile.gettempdir()) / f"fleet-test-domain-{found}"
        with lock_file.open("w") as lock, suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield found
            return
    raise AssertionError("no domain is free")


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    with free_domain() as found:
        yield found
