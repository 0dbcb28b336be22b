"""The simulator's drawing thread: each camera gets its turn, and a hanging thread does not delay the exit."""

from __future__ import annotations

import threading

import pytest

from robots.simulator.joints.frames import camera_pose
from robots.simulator.joints.joint_table import HOME
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import BODIES
from robots.simulator.topics.cameras.drawing_thread import DrawingThread, Moment
from tests.processes import PATIENCE_S
from tests.simulator.conftest import room

PHYSICS = Physics(room(), BODIES["tiago"], Pose(0.0, 0.0, 0.0))


def moment(number: int) -> Moment:
    return Moment(0, float(number), PHYSICS.snapshot(), camera_pose(HOME))


class SlowCamera:
    """A camera that takes a picture each time `shutter` is released."""

    def __init__(self) -> None:
        self.taken: list[float] = []
        self.shutter = threading.Semaphore(0)
        self.begun = threading.Semaphore(0)

    def draw_and_publish(self, _thread: DrawingThread, moment: Moment) -> None:
        self.begun.release()
        self.shutter.acquire(timeout=PATIENCE_S)
        self.taken.append(moment.monotonic_s)


@pytest.fixture
def thread():
    thread = DrawingThread(PHYSICS)
    yield thread
    thread.close()


def test_a_fast_camera_starves_no_other_and_gets_its_newest(thread):
    fast, other = SlowCamera(), SlowCamera()
    thread.request(fast, moment(1))
    assert fast.begun.acquire(timeout=PATIENCE_S)
    thread.request(other, moment(2))
    for number in (3, 4, 5):
        thread.request(fast, moment(number))
    fast.shutter.release()
    assert other.begun.acquire(timeout=PATIENCE_S)
    other.shutter.release()
    assert fast.begun.acquire(timeout=PATIENCE_S)
    fast.shutter.release()
    thread.close()
    assert (fast.taken, other.taken) == ([1.0, 5.0], [2.0])


def test_a_thread_that_hangs_holds_no_exit_up(thread):
    stuck = SlowCamera()
    thread.request(stuck, moment(1))
    assert stuck.begun.acquire(timeout=PATIENCE_S)
    closing = threading.Thread(target=thread.close, daemon=True)
    closing.start()
    closing.join(timeout=PATIENCE_S)
    assert not closing.is_alive()
    stuck.shutter.release()
