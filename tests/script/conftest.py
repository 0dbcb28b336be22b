"""Consoles that several files share, because a console takes ten seconds of computing to start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from xdist.scheduler import LoadFileScheduling

from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack
from tests.script.house import House, running_house

# In this order. Each file leaves its robot online, without a stop and with space to drive a metre, and nobody else in
# control. Only the last file of a console may leave anything.
SHARING = {
    "tests/script/programs/test_programs.py": "stack",
    "tests/script/programs/test_generated_client.py": "stack",
    "tests/script/programs/test_foxglove.py": "stack",
    "tests/script/programs/test_rosbridge_door.py": "stack",
    "tests/script/programs/test_rosbridge.py": "stack",
    "tests/script/test_pending_stop.py": "stack",
    "tests/script/test_camera.py": "stack",
    "tests/script/programs/test_navigation.py": "stack",
    "tests/script/audit/test_audit_without_postgresql.py": "house",  # first: it compares the log with the robot
    "tests/script/test_two_webs.py": "house",
}


class ByConsole(LoadFileScheduling):
    """Runs the tests of a file in one process, and all tests of a shared console too."""

    def _split_scope(self, nodeid: str) -> str:
        return SHARING.get(_file(nodeid), _file(nodeid))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByConsole:
    """Distribute the tests; this replaces `--dist`."""
    return ByConsole(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the files of shared consoles at the end, in their order."""
    order = list(SHARING)
    shared = [item for item in items if _file(item.nodeid) in SHARING]
    shared.sort(key=lambda item: order.index(_file(item.nodeid)))
    items[:] = [item for item in items if item not in shared] + shared


def _file(nodeid: str) -> str:
    return nodeid.partition("::")[0]


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
