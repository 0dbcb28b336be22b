"""A recorder with a real rosmaster, which ends."""

from __future__ import annotations

from pathlib import Path

from tests.recorder_process import RecorderProcess, ends_with_its_robot
from tests.ros.bridge_support import tiago_config


def test_recordings_end_with_the_master(make_master, tmp_path: Path) -> None:
    master = make_master()
    recorder = RecorderProcess(tiago_config(master, tmp_path), master.environment(), tmp_path)
    ends_with_its_robot(recorder, master.kill)
