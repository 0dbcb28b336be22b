"""``manage.py replay_gate``: the verdicts of a trace or a rosbag, in words."""

from __future__ import annotations

import math
from io import StringIO

import numpy as np
import pytest
from django.core.management import CommandError, call_command

from robots.bridge.gate_trace import Recorder
from robots.shared.geometry.poses import STILL, Velocity
from tests.gate.conftest import Feeder, tiago_profile


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """The file of a trace of 2 s in which obstacles come closer on all sides."""
    path = tmp_path_factory.mktemp("trace") / "wall.gate"
    feeder, sent = Feeder(tiago_profile()), STILL
    with Recorder(path, feeder.gate.profile) as recorder:
        feeder.gate = recorder.recorded(feeder.gate)
        for tick in range(40):
            feeder.now_s += 0.05
            feeder.ranges = np.full(571, 2.0 - 0.04 * tick)
            feeder.all()
            sent = feeder.gate.decide(Velocity(0.6, 0.0, 0.0), sent, feeder.now_s).velocity
            feeder.velocity = sent
    return path


def replayed(*arguments):
    out = StringIO()
    call_command("replay_gate", *arguments, stdout=out)
    return out.getvalue()


def test_a_trace_replays_the_same_verdicts_and_changes(wall):
    printed = replayed(str(wall))
    assert "40 decisions, 0 other than recorded" in printed
    assert "mover" in printed and "laser" in printed


def test_a_gate_that_answers_otherwise_fails_and_shows_both(wall, monkeypatch, capsys):
    monkeypatch.setattr(
        "robots.bridge.gate.motion.safe_twist.arc.speed", lambda twist: 2.0 * math.hypot(*twist[:2])
    )
    with pytest.raises(SystemExit, match="1"):
        call_command("replay_gate", str(wall))
    assert "recorded: " in capsys.readouterr().out


@pytest.mark.parametrize("text", [b"no trace at all", b""])
def test_a_file_that_is_none_is_refused_in_words(tmp_path, text):
    file = tmp_path / "rubbish.gate"
    file.write_bytes(text)
    with pytest.raises(CommandError, match=r"rubbish\.gate"):
        replayed(str(file))


@pytest.mark.django_db
def test_a_bag_needs_a_robot_that_there_is(tmp_path):
    with pytest.raises(CommandError, match="no robot 'nobody'"):
        replayed(str(tmp_path / "drive.bag"), "--robot", "nobody")
