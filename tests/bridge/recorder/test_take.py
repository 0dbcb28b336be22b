"""One recording on disks that fill, are slow, vanish or are read-only: it ends with a code, and its file opens."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import uuid4

import pytest
from mcap.reader import make_reader

from robots.bridge.recorder import take
from robots.bridge.recorder.black_box.ring import Message, Origin
from robots.bridge.recorder.clock import RecordingClock
from robots.bridge.recorder.files import finished_files, recovery
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.recorder.take import Take
from robots.shared.records.record_sink import TakenRecording
from robots.shared.wire import Refusal
from tests.processes import until

SCAN = Origin("/scan", "ros1", "sensor_msgs/LaserScan", "0", "float32 x", "/laser")
WORDS = Origin("/scan", "ros1", "std_msgs/String", "1", "string data", "/laser")


class Recording:
    """A take, and what became of it."""

    def __init__(self, directory: RecordingDirectory, first: Sequence[Message] = ()) -> None:
        self.results: list[TakenRecording | Refusal] = []
        about = TakenRecording(
            uuid4(), "robot", "by_hand", time.time(), time.time(), 0, str(directory.path), "", []
        )
        self.take = Take(
            directory,
            about,
            RecordingClock(),
            lambda _, result: self.results.append(result),
            lambda _: None,
        )
        self.take.start(first)

    def put(self, origin: Origin = SCAN, size: int = 1000) -> None:
        self.take.put(Message(origin, 1, time.monotonic_ns(), os.urandom(size)))

    def writes(self) -> None:
        """Wait until what was put is on disk."""
        before = self.take.bytes
        until(lambda: self.take.bytes > before, "bytes")

    def result(self) -> Any:
        return until(lambda: self.results and self.results[0], "a result")


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    monkeypatch.setattr(take, "FLUSH_S", 0.02)


@pytest.fixture
def directory(tmp_path: Path) -> RecordingDirectory:
    return RecordingDirectory(tmp_path / "recordings", 10**9)


def messages(path: Path) -> int:
    with path.open("rb") as stream:
        return sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())


def test_types_and_dropped_messages_are_in_file_and_result(directory, monkeypatch) -> None:
    recording = Recording(directory)
    recording.put(SCAN)
    recording.put(WORDS)
    recording.writes()
    with patch.object(directory, "make_room", side_effect=lambda _: time.sleep(0.5) or []):
        until(lambda: recording.put(SCAN, 5_000_000) or recording.take.dropped, "a dropped message")
    recording.take.end()
    taken = recording.result()
    scan, words = taken.topics
    assert (scan.type, scan.dropped) == ("sensor_msgs/LaserScan", taken.dropped) and scan.dropped
    assert (words.type, words.messages, words.dropped) == ("std_msgs/String", 1, 0)
    path = directory.path / taken.name
    assert messages(path) == scan.messages + 1 and finished_files.read(path) == taken


def test_a_full_ring_costs_no_message_that_follows(directory) -> None:
    recording = Recording(directory, first=[Message(SCAN, 0, 0, bytes(1_000_000)) for _ in range(40)])
    for _ in range(20):
        recording.put(SCAN, 1_000_000)
    recording.take.end()
    assert (recording.result().dropped, recording.result().topics[0].messages) == (0, 60)


def test_a_full_disk_ends_it_with_a_file_that_opens(directory) -> None:
    recording = Recording(directory)
    recording.put()
    recording.writes()
    with patch.object(directory, "_free_on_disk", return_value=0):
        recording.put()
        taken = recording.result()
    assert recording.take.refusal.code == "disk_full" and taken.ended_by == "The disk for recordings is full."
    assert messages(directory.path / taken.name) >= 1


def test_a_disk_that_fills_while_it_writes_leaves_a_file_for_later(directory) -> None:
    recording = Recording(directory)
    recording.put()
    recording.writes()
    with patch("robots.bridge.recorder.take.os.fsync", side_effect=OSError(28, "No space left on device")):
        recording.put()
        assert recording.result().code == "disk_full"
    assert [str(one) for one in finished_files.finish_cut(directory)] == [str(recording.take.about.recording)]
    (taken,) = finished_files.without_row(directory)
    assert taken.cut and messages(directory.path / taken.name) >= 1


def test_a_vanished_or_read_only_disk_is_named(directory, tmp_path) -> None:
    recording = Recording(directory)
    recording.put()
    recording.writes()
    shutil.rmtree(directory.path)
    recording.put()
    assert recording.result().code == "disk_gone"
    with patch.object(directory, "begin", side_effect=OSError(30, "Read-only file system")):
        refused = Recording(directory)
        assert refused.result().code == "disk_read_only" and not refused.take.is_open


def test_a_slow_disk_is_named_and_nobody_waits(directory, monkeypatch) -> None:
    monkeypatch.setattr(take, "SLOW_S", 0.1)
    released = threading.Event()
    recording = Recording(directory)
    with patch("robots.bridge.recorder.take.os.fsync", side_effect=lambda _: released.wait(10)):
        recording.put()
        until(lambda: recording.take.trouble, "the trouble")
        assert recording.take.trouble.code == "disk_slow"
        began_s = time.monotonic()
        for _ in range(100):
            recording.put()
        assert time.monotonic() - began_s < 1.0
        released.set()
    until(lambda: recording.take.trouble is None, "the end of the trouble")
    recording.take.end()
    assert messages(directory.path / recording.result().name) == 101


def test_a_time_of_day_that_is_set_does_not_jump_in_the_file(directory) -> None:
    recording = Recording(directory)
    recording.put()
    recording.writes()
    real = time.time_ns
    with patch("robots.bridge.recorder.take.time.time_ns", side_effect=lambda: real() - 3600 * 10**9):
        recording.put()
        recording.writes()
    recording.put()
    recording.take.end()
    taken = recording.result()
    assert 0.0 <= taken.ends - taken.begins < 60.0
    with (directory.path / taken.name).open("rb") as stream:
        notes = [one.metadata for one in make_reader(stream).iter_metadata() if one.name == take.CLOCK]
    assert [round(float(note["time_of_day_ahead_s"])) for note in notes] == [-3600, 0]


def test_the_directory_is_not_walked_each_second(directory) -> None:
    recording = Recording(directory)
    recording.put()
    recording.writes()
    with patch("robots.bridge.recorder.files.directory.os.scandir", side_effect=AssertionError):
        with patch.object(Path, "iterdir", side_effect=AssertionError):
            for _ in range(3):
                recording.put()
                recording.writes()
        free = recording.take.free_bytes
    recording.take.end()
    assert free is not None and 4000 <= 10**9 - free <= recording.result().bytes


def test_a_quota_without_room_leaves_no_empty_file(tmp_path: Path) -> None:
    directory = RecordingDirectory(tmp_path / "recordings", 6_000_000)
    recording = Recording(directory, first=[Message(SCAN, 0, 0, bytes(1_000_000)) for _ in range(10)])
    assert recording.result().code == "quota_full" and not recording.take.is_open
    recording = Recording(directory)
    until(lambda: recording.take.is_open, "the file")
    with patch.object(directory, "_free_on_disk", return_value=0):
        recording.put()
        assert recording.result().code == "disk_full"
    assert list(directory.path.iterdir()) == []


def test_too_little_memory_is_no_end_of_a_file(directory) -> None:
    recording = Recording(directory)
    for _ in range(3):
        recording.put()
        recording.writes()
    with patch("robots.bridge.recorder.take.os.fsync", side_effect=OSError(28, "No space left on device")):
        recording.put()
        recording.result()
    (path,) = directory.path.glob("*.part")
    size = path.stat().st_size
    decompress = recovery.zstandard.decompress
    with patch.object(recovery.zstandard, "decompress") as unpacked:
        unpacked.side_effect = lambda *given: decompress(*given) if unpacked.call_count < 2 else no_memory()
        assert list(finished_files.finish_cut(directory)) == []
    assert path.stat().st_size == size
    assert len(list(finished_files.finish_cut(directory))) == 1
    assert messages(path.with_suffix(".mcap")) == 4


def no_memory() -> None:
    raise MemoryError
