"""A tap of a real rosmaster for tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ros.bridge_support import tiago_config
from tests.tap_process import Tap


@pytest.fixture(scope="module")
def tap(rosmaster, ros, tmp_path_factory) -> Iterator[Tap]:
    config = tiago_config(rosmaster, tmp_path_factory.mktemp("tap"))
    process = Tap(config, rosmaster.environment())
    yield process
    process.stop()
