"""Recorded drives: the gate repeats its answers bit for bit."""

from __future__ import annotations

import gzip
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from robots.bridge.gate.arm.discs import Posture
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.obstacles.depth_camera import Frame, frame_of
from robots.bridge.gate.sensing.depth import DepthImage, Lens, picture_of_image
from robots.bridge.gate.values import LaserScan
from robots.bridge.gate_trace import BadTrace, Recorder, replay
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER, Feeder, tiago_profile


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Three seconds towards an obstacle, with noise, NaN and infinities."""
    path = tmp_path / "drive.gate"
    random = np.random.default_rng(3)
    feeder = Feeder(tiago_profile())
    with Recorder(path, feeder.gate.profile) as recorder:
        feeder.gate = recorder.recorded(feeder.gate)
        sent = STILL
        for tick in range(60):
            feeder.now_s += 0.05
            feeder.ahead_at(1.6 - 0.02 * tick + random.normal(0.0, 0.01))
            feeder.ranges[random.integers(0, 571, 20)] = math.nan
            feeder.all()
            asked = Velocity(1.0, 0.0, random.normal(0.0, 0.5))
            sent = feeder.gate.decide(asked, sent, feeder.now_s).velocity
            feeder.velocity = Velocity(0.3 * sent.vx + 0.7 * feeder.velocity.vx, 0.0, sent.w)
        feeder.gate.decide(Velocity(math.nan, 0.0, 0.0), sent, feeder.now_s)
    return path


def test_a_recorded_drive_gives_the_same_verdicts_bit_for_bit(drive):
    decisions = list(replay(drive))
    assert len(decisions) == 61
    assert all(decision.same for decision in decisions)
    assert len({decision.recorded.code for decision in decisions}) > 2


def test_replay_shows_where_another_gate_differs(drive):
    class Timid(Gate):
        def decide(self, asked, sent, now_s):
            verdict = super().decide(asked, sent, now_s)
            return verdict._replace(velocity=Velocity(0.5 * verdict.velocity.vx, 0.0, 0.0))

    decisions = list(replay(drive, Timid))
    assert not all(decision.same for decision in decisions)
    assert decisions[0].replayed.velocity.vx == 0.5 * decisions[0].recorded.velocity.vx


def test_unreadable_trace_is_explained_in_words(drive, tmp_path):
    cut = tmp_path / "cut.gate"
    cut.write_bytes(drive.read_bytes()[:-200])
    text = tmp_path / "text.gate"
    text.write_text("no trace")
    empty = tmp_path / "empty.gate"
    with gzip.open(empty, "wb"):
        pass
    foreign = tmp_path / "foreign.gate"
    with gzip.open(drive) as good, gzip.open(foreign, "wb") as file:
        whole = good.read()
        file.write(whole.replace(b"observe_odometry", b"observe_anything"))
    for path in (cut, text, empty, foreign, tmp_path / "absent.gate"):
        with pytest.raises(BadTrace, match=path.stem):
            list(replay(path))


def pictured() -> Frame:
    """A real depth frame of an obstacle ahead, with unmeasured pixels."""
    random = np.random.default_rng(5)
    ahead = random.normal(1.5, 0.01, (120, 160)).astype(np.float32)
    ahead[::7, ::5], ahead[::11, ::3] = math.nan, math.inf
    image = DepthImage(160, 120, "32FC1", False, 4 * 160, ahead.tobytes())
    to_base = np.eye(4)
    to_base[:3, :3] = [[0.0, -0.6, 0.8], [-1.0, 0.0, 0.0], [0.0, -0.8, -0.6]]
    to_base[:3, 3] = 0.1, 0.0, 1.1
    frame = frame_of(picture_of_image(image, Lens.seeing(1.1, 160, 120)), to_base, DepthView(1.15))
    assert len(frame.columns.points)
    return frame


WIDE = math.pi * 1e8  # a number that needs all 53 bits of its significand
INPUTS = {
    "observe_odometry": [
        (WIDE, 0.1 + 0.2, Pose(1 / 3, -0.0, 5e-324), Velocity(math.inf, math.nan, -math.inf), 3)
    ],
    "observe_odometry_alike": [(WIDE, 0.1 + 0.2)],
    "observe_scan": [
        (LaserScan(LASER, WIDE, 0.1, ranges, -1.6, 0.1 / 3, 0.05, 25.0), True)
        for ranges in (
            np.array([1 / 3, math.nan, math.inf, -math.inf, -0.0]),
            np.array([0.1, math.nan, 25.0], dtype=np.float32),
            [0.1, math.inf],
        )
    ],
    "observe_range": [("sonar", WIDE, 0.1, 1 / 3, math.inf), ("sonar", WIDE, 0.1, math.nan, 1.0)],
    "observe_depth": [(pictured(), WIDE, 1 / 3)],
    "observe_bad_depth": [("its pictures are \u2018mono8\u2019",)],
    "observe_posture": [
        (Posture(at_home=False, discs=((1 / 3, -0.0, 0.1), (0.5, 0.25, 0.1))), WIDE),
        (Posture(at_home=True, discs=()), 0.1),
        (Posture(at_home=False), 0.1),
    ],
    "observe_operator": [(1 / 3,), (None,)],
    "observe_new_driver": [()],
    "observe_camera_view": [(1 / 3,), (None,)],
    "observe_lost_limb": [("torso",), (None,)],
    "forget": [(True,), (False,)],
    "observe_acknowledgement": [(1 / 3, 100.1)],
}


def bits(value):
    """Return a form of the value that is equal only if type and bits are the same."""
    if isinstance(value, np.ndarray):
        order = value.flags.f_contiguous, value.flags.c_contiguous
        return np.ndarray, value.dtype.str, value.shape, order, value.tobytes("A")
    if isinstance(value, (tuple, list)):
        return type(value), [bits(one) for one in value]
    return type(value), struct.pack("d", value) if isinstance(value, float) else value


@pytest.mark.parametrize("method", [name for name in vars(Gate) if name.startswith("observe_")])
def test_all_gate_inputs_are_restored_to_the_last_bit(method, tmp_path):
    heard = []

    class Listening(Gate):
        pass

    setattr(Listening, method, lambda _, *arguments: heard.append(arguments))
    path = tmp_path / "arguments.gate"
    with Recorder(path, tiago_profile()) as recorder:
        gate = recorder.recorded(Gate(tiago_profile()))
        for arguments in INPUTS[method]:
            getattr(gate, method)(*arguments)
    assert list(replay(path, Listening)) == []
    assert bits(heard) == bits(INPUTS[method])


def test_a_trace_with_fewer_arguments_is_replayed(tmp_path, monkeypatch):
    """Traces of 1.0.0-rc1 and before lack `thins` and `messages`."""
    path = tmp_path / "old.gate"
    with Recorder(path, tiago_profile()) as recorder:
        for method, arguments in (("observe_odometry", INPUTS["observe_odometry"][0]), ("forget", ())):
            recorder._write((method, list(arguments[:4]), None))
    assert list(replay(path)) == []
