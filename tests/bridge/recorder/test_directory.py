"""The directory of recordings: the quota takes the oldest black boxes, and nothing that somebody keeps."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from uuid import UUID, uuid4

import pytest

from robots.bridge.recorder.files.directory import FILE, NoRoom, RecordingDirectory, refusal_of
from robots.shared.wire import RecordingKind

KILO = 1000


@pytest.fixture
def directory(tmp_path: Path) -> RecordingDirectory:
    directory = RecordingDirectory(tmp_path / "recordings", 100 * KILO)
    directory.prepare()
    return directory


def add(directory: RecordingDirectory, kind: RecordingKind, begins: float, size: int = 20 * KILO) -> UUID:
    """Add a finished recording."""
    recording = uuid4()
    draft = directory.begin(kind, recording, begins)
    draft.stream.write(bytes(size))
    directory.publish(draft)
    return recording


def recordings(directory: RecordingDirectory) -> list[UUID]:
    return [entry.recording for entry in directory.entries()]


def test_the_oldest_black_boxes_make_room(directory) -> None:
    old = add(directory, "black_box", 1e9)
    by_hand = add(directory, "by_hand", 0.5e9)
    kept = add(directory, "black_box", 0.9e9)
    young = add(directory, "black_box", 1.1e9)
    directory.keep(kept)
    assert directory.make_room(10 * KILO) == []
    assert directory.make_room(30 * KILO) == [old]
    assert recordings(directory) == [by_hand, kept, young]
    assert directory.make_room(50 * KILO) == [young]
    with pytest.raises(NoRoom) as refused:
        directory.make_room(70 * KILO)
    assert refused.value.refusal.code == "quota_full"
    assert set(recordings(directory)) == {by_hand, kept}
    assert [path.suffix for path in directory.path.iterdir() if str(old) in path.name] == []


def test_a_full_disk_takes_no_black_box_away(directory, monkeypatch) -> None:
    add(directory, "black_box", 1e9)
    room = os.statvfs(directory.path)
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result((*room[:4], 10, *room[5:])))
    with pytest.raises(NoRoom) as refused:
        directory.make_room(KILO)
    assert refused.value.refusal.code == "disk_full"
    assert directory.free_bytes() == 0 and len(recordings(directory)) == 1


def test_what_others_write_counts_with_the_next_count(directory, monkeypatch) -> None:
    other = RecordingDirectory(directory.path, 100 * KILO)
    assert directory.make_room(10 * KILO) == []
    old = add(other, "black_box", 1e9, 60 * KILO)
    directory.wrote(30 * KILO)
    assert (
        directory.make_room(60 * KILO) == []
    )  # there were 30 kB by its own account; it counts before it removes
    monkeypatch.setattr("robots.bridge.recorder.files.directory.COUNT_S", 0.0)
    assert directory.make_room(60 * KILO) == [old]


def test_a_row_is_asked_for_until_it_is_stored(directory) -> None:
    first, second = add(directory, "by_hand", 1e9), add(directory, "by_hand", 2e9)
    directory.stored(first)
    assert [str(second) in path.name for path in directory.without_row()] == [True]


def test_only_cut_files_without_a_writer_are_yielded(directory) -> None:
    written = directory.begin("by_hand", uuid4(), 1e9)
    cut = directory.begin("by_hand", uuid4(), 2e9)
    cut.stream.close()  # its process was killed
    found = list(directory.cut())
    assert [draft.path for draft in found] == [cut.path]
    found[0].stream.close()
    written.stream.close()


def test_other_files_are_left_alone(directory) -> None:
    for name in ("notes.mcap", "20261130T103000Z-black_box-..mcap", f"x-{uuid4()}.mcap"):
        (directory.path / name).write_bytes(bytes(90 * KILO))
    assert directory.entries() == []
    with pytest.raises(NoRoom):
        directory.make_room(20 * KILO)
    assert len(list(directory.path.glob(f"*{FILE}"))) == 3


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (errno.ENOSPC, "disk_full"),
        (errno.EROFS, "disk_read_only"),
        (errno.ENOENT, "disk_gone"),
        (errno.EIO, "disk_failed"),
    ],
)
def test_what_a_disk_refuses_has_a_code(number: int, code: str) -> None:
    assert refusal_of(OSError(number, os.strerror(number))).code == code


def test_a_disk_that_is_not_mounted_is_gone(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        RecordingDirectory(tmp_path / "mnt" / "recordings", KILO).prepare()
