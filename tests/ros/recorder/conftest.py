"""Recorders and publishers for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rospy

from tests.recorder_process import RecorderProcess
from tests.ros.bridge_support import tiago_config


@pytest.fixture
def killed_recorder(rosmaster, ros, tmp_path: Path) -> Callable[[], Any]:
    """``with killed_recorder() as recorder``: always of the same robot, and killed at the end."""

    @contextmanager
    def begin() -> Iterator[RecorderProcess]:
        config = tiago_config(rosmaster, tmp_path, robot_id="7c1f7d7a3f5e4f2a9f0b2f3c6c1b2a11")
        process = RecorderProcess(config, rosmaster.environment(), tmp_path)
        try:
            yield process
        finally:
            process.kill()

    return begin


@pytest.fixture
def publish() -> Iterator[Callable[..., rospy.Publisher]]:
    """``publish(topic, message)`` publishes it for all who come later; ``latch=False``: ten times a second."""
    publishers: list[rospy.Publisher] = []
    timers: list[rospy.Timer] = []

    def begin(topic: str, message: Any, latch: bool = True) -> rospy.Publisher:
        publisher = rospy.Publisher(topic, type(message), queue_size=100, latch=latch)
        publishers.append(publisher)
        publisher.publish(message)
        if not latch:
            timers.append(rospy.Timer(rospy.Duration(0.1), lambda _: publisher.publish(message)))
        return publisher

    yield begin
    for timer in timers:
        timer.shutdown()
    for publisher in publishers:
        publisher.unregister()
