"""Recorded motions of a robot, whatever its ROS."""

from __future__ import annotations

import queue
import time
from unittest.mock import Mock

from robots.bridge.robot.tasks import motions
from robots.bridge.robot.tasks.motions import RecordedMotions
from tests.bridge.support import CONFIG


def test_a_flapping_node_does_not_speed_up_motion_reading(monkeypatch):
    monkeypatch.setattr(motions, "JOINED_GAP_S", 0.5)
    readings: queue.SimpleQueue[float] = queue.SimpleQueue()
    monkeypatch.setattr(RecordedMotions, "read", lambda _self: readings.put(time.monotonic()))
    robot = Mock(config=CONFIG)
    robot.tasks.routing.connected.return_value = ["/play_motion"]
    joined = RecordedMotions(robot, Mock()).joined
    began_s = time.monotonic()
    joined()
    readings.get(timeout=10)
    joined()
    assert readings.get(timeout=10) - began_s >= 0.5
