"""The fixtures of `tests.sides`, for what only a robot with ROS 2 can do to its driver."""

from collections.abc import Iterator

import pytest

from tests.sides import conftest
from tests.sides.side import Side, running_side

fault, forks, robot, simulator, visitor = (
    conftest.fault,
    conftest.forks,
    conftest.robot,
    conftest.simulator,
    conftest.visitor,
)
bridge, config, hand, start, watchdog = (
    conftest.bridge,
    conftest.config,
    conftest.hand,
    conftest.start,
    conftest.watchdog,
)


@pytest.fixture(scope="module")
def side(forks: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Side]:
    with running_side("ros2", tmp_path_factory.mktemp("side")) as side:
        yield side
