"""A recorder that is killed at any moment, while it writes or finishes: every file opens, and little is lost."""

from __future__ import annotations

import random
import time

import pytest
from sensor_msgs.msg import Image, LaserScan

from robots.bridge.recorder.recorder_messages import End
from tests.processes import until
from tests.recorder_process import messages_of

LOST_S = 2.0  # a second that waits for its flush, and a slow computer


@pytest.mark.parametrize(
    "round_", range(20), ids=lambda number: f"{number}" if number < 3 else f"more {number}"
)
def test_a_killed_recorder_leaves_a_file_that_opens(killed_recorder, publish, round_: int) -> None:
    draw = random.Random(round_)  # noqa: S311 - moments, no secrets
    publish("/scan_raw", LaserScan(ranges=[1.0] * 300), latch=False)
    picture = Image(height=100, width=100, encoding="rgb8", step=300, data=draw.randbytes(30_000))
    publish("/image", picture, latch=False)
    with killed_recorder() as recorder:
        recording = recorder.begins("all")
        until(lambda: recorder.bytes > 30_000, "bytes")
        time.sleep(draw.uniform(0.0, 1.5))
        if finishes := draw.random() < 0.3:
            recorder.say(End(recording))
            time.sleep(draw.uniform(0.0, 0.05))
        killed = time.time()
    with killed_recorder() as recorder:
        taken = recorder.finished(recording)
    assert {"/scan_raw", "/image"} <= messages_of(recorder.directory / taken.name).keys()
    assert taken.thumbnail and (taken.cut or finishes)
    assert killed - taken.ends < LOST_S
