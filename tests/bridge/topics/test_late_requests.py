"""A parameter that is read slowly is not set, or deleted, after its person was told that this is not known."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace

from robots.bridge.topics.inspector.requests import Inspector
from robots.bridge.topics.inspector_messages import InspectorQuery
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from tests.bridge.support import CONFIG
from tests.processes import PATIENCE_S

NAME = "/volume"


class SlowSide:
    """Parameters that are read until the time limit of the request is over."""

    def __init__(self, until_s: float) -> None:
        self.changed: list[str] = []
        self._until_s = until_s

    def parameter(self, _name: str) -> Any:
        while time.monotonic() < self._until_s:
            time.sleep(0.001)
        return 1

    def has_parameter(self, _name: str) -> bool:
        return True

    def set_parameter(self, name: str, _value: Any, require_time: Callable[[], None]) -> None:
        require_time()
        self.changed.append(name)

    def delete_parameter(self, name: str, require_time: Callable[[], None]) -> None:
        require_time()
        self.changed.append(name)


@pytest.mark.parametrize("ask", [wire.SetParameter(NAME, 5), wire.DeleteParameter(NAME)])
@pytest.mark.parametrize("late", [True, False])
def test_nothing_is_changed_after_the_refusal(ask: Any, late: bool) -> None:
    until_s = time.monotonic() + 0.05
    side, said = SlowSide(until_s), queue.SimpleQueue[bytes]()
    requests = Inspector(replace(CONFIG, allowed=[Allowed("set", NAME)]), side, said.put)  # type: ignore[arg-type]
    question = InspectorQuery(1, ask, until_s if late else until_s + PATIENCE_S)
    requests.handle_line(wire.encode(question))
    said.get(timeout=PATIENCE_S)
    assert side.changed == ([] if late else [NAME])
