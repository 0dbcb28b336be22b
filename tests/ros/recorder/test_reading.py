"""Which topics a recording of everything reads."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from robots.bridge.recorder.recorder import Wanted
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.recorder import reading
from robots.bridge.ros.recorder.reading import Reading


class Taker:
    """Takes nothing, and hears how many topics are left out."""

    def __init__(self) -> None:
        self.counts: list[int] = []

    def left_out(self, count: int) -> None:
        self.counts.append(count)


@pytest.fixture
def master(monkeypatch) -> None:
    """A robot with 330 topics, of which 20 are pictures."""
    topics = [f"/topic_{number}" for number in range(330)]
    types = dict.fromkeys(topics[:20], "sensor_msgs/Image")
    state = SimpleNamespace(publishers={topic: ["/node"] for topic in topics}, types=types)
    monkeypatch.setattr(reading, "Master", lambda *_: SimpleNamespace(system_state=lambda: state))
    monkeypatch.setattr(reading.rosgraph, "get_master_uri", lambda: "")


def test_the_taker_hears_how_many_are_left_out(master, tmp_path: Path) -> None:
    taker = Taker()
    everything = Reading(Definitions(tmp_path), taker)._others(Wanted({"/chosen": 0.0}, "all"))
    assert len(everything) == 299 and "/topic_0" not in everything  # a picture
    Reading(Definitions(tmp_path), taker)._others(Wanted({}, "contacts"))
    assert taker.counts == [31, 0]
