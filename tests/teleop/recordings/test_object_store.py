"""A recording in the object store, through the API: replay, downloads, and what is said while the store is away."""

from __future__ import annotations

import io
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.recordings.models import Place, Recording
from robots.recordings.s3 import object_file
from tests.robots.recordings.s3.storage import Storage, _storage, s3
from tests.teleop.recordings.test_door import content, get, recording
from tests.teleop.recordings.test_sight import BEGAN

pytestmark = pytest.mark.django_db
__all__ = ["_storage", "recording", "s3"]


@pytest.fixture
def stored(
    recording: Recording, s3: Storage, tmp_path: Path, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> Recording:
    """The recording, whose file is only in the store."""
    monkeypatch.setattr(object_file, "AGAIN_S", 0.0)
    monkeypatch.setattr(object_file, "_quiet_until_s", 0.0)
    settings.FLEET_S3 = s3.store
    s3.ask("put_object", Key="lab/one.mcap", Body=(tmp_path / "one.mcap").read_bytes())
    s3.ask("put_object", Key="lab/one.jpg", Body=b"\xff\xd8 picture")
    (tmp_path / "one.mcap").rename(tmp_path / "whole.mcap")
    recording.place, recording.object, recording.file = Place.S3, "lab/one.mcap", ""
    recording.thumbnail = True
    recording.save()
    return recording


def test_replay_and_downloads_are_as_those_of_a_file(
    stored: Recording, operator: User, tmp_path: Path
) -> None:
    whole = (tmp_path / "whole.mcap").read_bytes()
    assert get(operator, stored).json()["contents"]["has_views"]
    views = get(operator, stored, "/views?from=2&to=4").json()
    assert [at for at, *_ in views["views"]] == [round(2 + tick / 10, 1) for tick in range(21)]
    series = get(operator, stored, "/series?topic=/odom&field=speeds[1]&from=0&to=1").json()
    assert series["values"] == [-float(tick) for tick in range(11)]
    assert content(get(operator, stored, "/thumbnail")) == b"\xff\xd8 picture"
    got = content(get(operator, stored, "/file", Range="bytes=0-9999"))
    answer = get(operator, stored, "/file", Range="bytes=10000-")
    assert answer.status_code == 206 and got + content(answer) == whole
    cut = io.BytesIO(content(get(operator, stored, "/file?from=2&to=3&topics=/odom")))
    times = [message.log_time / 1e9 - BEGAN.timestamp() for _, _, message in make_reader(cut).iter_messages()]
    assert min(times) >= 1.999 and max(times) <= 3.001
    assert content(get(operator, stored, "/file?format=bag&from=2&to=3")).startswith(b"#ROSBAG V2.0")
    assert Record.objects.filter(kind="recording.download").count() == 3


def test_a_store_that_is_away_or_has_lost_it_is_said(
    stored: Recording, operator: User, s3: Storage, settings: Any
) -> None:
    rests = ("", "/views?from=0&to=1", "/file", "/file?format=bag", "/thumbnail")

    def codes() -> set[tuple[int, str]]:
        answers = [get(operator, stored, rest) for rest in rests]
        return {(answer.status_code, answer.json()["code"]) for answer in answers}

    for fault in ((503, "SlowDown"), (500, "InternalError"), (403, "AccessDenied")):
        s3.fault = lambda _, fault=fault: fault
        assert codes() == {(503, "store_away")}, fault
    s3.fault = lambda _: None
    assert get(operator, stored).status_code == 200
    for key in s3.objects():
        s3.ask("delete_object", Key=key)
    assert codes() == {(503, "recording_lost")}
    settings.FLEET_S3 = None
    assert codes() == {(503, "store_away")}


def test_a_store_that_breaks_off_for_a_moment_is_asked_again(
    stored: Recording, operator: User, s3: Storage, tmp_path: Path
) -> None:
    broken = iter([True, False] * 100)
    s3.fault = lambda _: (503, "SlowDown") if next(broken) else None
    assert content(get(operator, stored, "/file")) == (tmp_path / "whole.mcap").read_bytes()


def test_a_store_that_does_not_answer_keeps_nobody_waiting(
    stored: Recording, operator: User, s3: Storage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(object_file, "PATIENCE_S", 0.2)
    silent = threading.Event()
    s3.fault = lambda _: silent.wait(5.0) and None  # type: ignore[func-returns-value]
    try:
        assert get(operator, stored).json()["code"] == "store_away"
        asked, began_s = len(s3.requests), time.monotonic()
        assert get(operator, stored, "/file").json()["code"] == "store_away"
        assert len(s3.requests) == asked and time.monotonic() - began_s < 1.0
    finally:
        silent.set()
    monkeypatch.setattr(object_file, "_quiet_until_s", 0.0)
    assert get(operator, stored).status_code == 200
