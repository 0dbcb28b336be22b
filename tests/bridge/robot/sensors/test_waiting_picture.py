"""While the robot rests, the depth camera's newest picture waits as it came. Whatever ends the rest takes it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from robots.bridge.gate.sensing.depth import DepthImage
from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.sensors import depth
from robots.bridge.robot.sensors.depth import DepthReception
from robots.shared.configuration.bridge_config import DepthSource
from robots.shared.configuration.gate_profile import DepthView
from tests.bridge.support import CONFIG

WIDTH, HEIGHT = 64, 48
TO_BASE = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.1], [0, 0, 0, 1]], float)


class Core:
    def __init__(self):
        self.rests, self.taken, self.bad = True, [], []

    @property
    def needs_fresh_sensors(self):
        return not self.rests

    def depth(self, frame, stamp_s, arrival_s):
        self.taken.append(stamp_s)

    def bad_depth(self, why):
        self.bad.append(why)


class Camera:
    """A depth camera; `calls` wait for the event loop."""

    def __init__(self, monkeypatch):
        self.now_s, self.core, self.calls, self.metres = 100.0, Core(), [], 2.0
        monkeypatch.setattr(depth.time, "monotonic", lambda: self.now_s)
        self.reception = Reception(CONFIG.topics)
        self.reception.core = self.core
        self.reception.mail._later = self.calls.append
        source = DepthSource("/depth", "sensor_msgs/Image", fov=1.0, height_m=1.1)
        frames = SimpleNamespace(pose_at=lambda frame, stamp_s: TO_BASE)
        reader = SimpleNamespace(image=lambda stamp_s: (stamp_s, "camera", self.image()))
        self.pictures = DepthReception(source, DepthView(1.1, 0.1), frames, self.reception, reader)

    def image(self):
        data = np.full(WIDTH * HEIGHT, self.metres, np.float32).tobytes()
        return DepthImage(WIDTH, HEIGHT, "32FC1", False, 4 * WIDTH, memoryview(data))

    def sees(self, *stamps_s):
        for stamp_s in stamps_s:
            self.now_s = stamp_s
            self.pictures.receive(stamp_s)


@pytest.fixture
def camera(monkeypatch):
    return Camera(monkeypatch)


def test_every_second_picture_is_prepared_at_rest(camera):
    camera.sees(100.0, 100.1)
    camera.reception.mail.take_waiting()
    camera.sees(100.2, 100.3)
    camera.reception.mail.take_waiting()
    assert camera.core.taken == [100.0, 100.2]
    assert not camera.calls, "nothing woke the loop"


def test_the_end_of_the_rest_takes_the_newest_picture(camera):
    camera.sees(100.0, 100.1)
    camera.core.rests = False
    camera.reception.take_waiting()
    camera.reception.take_waiting()
    assert camera.core.taken == [100.0, 100.1]
    camera.sees(100.15)
    assert not camera.calls, "too early after the picture that waited"
    camera.sees(100.2)
    assert len(camera.calls) == 1, "from now on each wakes the loop"


def test_a_picture_that_a_newer_one_outran_is_not_taken(camera):
    camera.sees(100.0, 100.1, 100.2)
    camera.reception.mail.take_waiting()
    camera.reception.take_waiting()
    assert camera.core.taken == [100.2]


def test_a_waiting_picture_that_shows_nothing_is_named(camera):
    camera.sees(100.0)
    camera.metres = math.nan
    camera.sees(100.1)
    camera.reception.take_waiting()
    camera.reception.mail.take_waiting()
    assert camera.core.taken == [100.0]
    assert len(camera.core.bad) == 1


def test_no_picture_waits_after_control(camera):
    camera.sees(100.0, 100.1)
    camera.pictures.forget()
    camera.reception.take_waiting()
    assert camera.core.taken == [100.0]
