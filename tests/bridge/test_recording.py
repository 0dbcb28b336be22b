"""Recorded drives: what a gate answered once, it answers again, bit for bit."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import STILL, Velocity
from robots.bridge.recording import BadRecording, Recorder, replay
from tests.gate.conftest import Feeder, tiago_profile


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Three seconds towards something, with noise, NaN and infinities."""
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


def test_another_gate_gives_other_verdicts_and_the_replay_shows_where(drive):
    class Timid(Gate):
        def decide(self, asked, sent, now_s):
            verdict = super().decide(asked, sent, now_s)
            return verdict._replace(velocity=Velocity(0.5 * verdict.velocity.vx, 0.0, 0.0))

    decisions = list(replay(drive, Timid))
    assert not all(decision.same for decision in decisions)
    assert decisions[0].replayed.velocity.vx == 0.5 * decisions[0].recorded.velocity.vx


def test_what_cannot_be_read_is_said_in_words(drive, tmp_path):
    cut = tmp_path / "cut.gate"
    cut.write_bytes(drive.read_bytes()[:-200])
    text = tmp_path / "text.gate"
    text.write_text("no recording")
    empty = tmp_path / "empty.gate"
    with gzip.open(empty, "wb"):
        pass
    foreign = tmp_path / "foreign.gate"
    with gzip.open(drive) as good, gzip.open(foreign, "wb") as file:
        whole = good.read()
        file.write(whole.replace(b"observe_odometry", b"observe_anything"))
    for path in (cut, text, empty, foreign, tmp_path / "absent.gate"):
        with pytest.raises(BadRecording, match=path.stem):
            list(replay(path))
