"""The thread of a tap that subscribes and unsubscribes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from robots.bridge.tap import source
from robots.bridge.tap.source import Source


def test_a_tap_that_unsubscribes_from_many_topics_shows_that_it_lives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s, silent_s = 0.0, list[float]()

    class Raw:
        def close(self) -> None:
            nonlocal now_s
            now_s += 1.0  # a master that is busy
            silent_s.append(now_s - tap.looked_s)

    monkeypatch.setattr(source, "time", SimpleNamespace(monotonic=lambda: now_s))
    server: Any = SimpleNamespace(inbox=None, forget=None)
    listen: Any = lambda *_: Raw()  # noqa: E731
    tap = Source(server, lambda *_: None, listen)
    tap._follow({f"/topic_{number}": 1 for number in range(10)})
    tap._follow({})
    assert silent_s == [1.0] * 10
