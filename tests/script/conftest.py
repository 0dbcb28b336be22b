"""Consoles that several files share, because a console takes ten seconds of computing to start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from xdist.scheduler import LoadFileScheduling

from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack
from tests.script.house import House, running_house

FOLDER = Path(__file__).parent
# In this order. Each file leaves its robot online, free, without a stop, and with space to drive a metre; only the
# last file of a console may leave anything.
SHARING = {
    "test_pending_stop.py": "stack",
    "test_camera.py": "stack",
    "test_programs.py": "stack",
    "test_generated_client.py": "stack",
    "test_navigation.py": "stack",
    "test_audit_without_postgresql.py": "house",  # first: it compares the whole log with the robot
    "test_two_webs.py": "house",
}


class ByConsole(LoadFileScheduling):
    """Runs the tests of a file in one process, and all tests of a shared console too."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        return SHARING.get(Path(file).name, file)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByConsole:
    """Distribute the tests."""
    return ByConsole(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the files of shared consoles at the end, in their order."""
    order = list(SHARING)
    shared = [item for item in items if item.path.name in SHARING and FOLDER in item.path.parents]
    shared.sort(key=lambda item: order.index(item.path.name))
    items[:] = [item for item in items if item not in shared] + shared


@pytest.fixture(scope="session")
def stack() -> Iterator[Stack]:
    """A console with one robot, which has two cameras."""
    with temporary_stack([replace(PRACTICE_ROBOTS[0], rear_camera=True)]) as running:
        yield running


@pytest.fixture(scope="session")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """A console with two web processes, PostgreSQL and Redis."""
    with running_house(tmp_path_factory.mktemp("house")) as running:
        yield running
