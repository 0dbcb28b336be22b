"""Decisions about finished files, carried out on the bridge's computer."""

from __future__ import annotations

import asyncio
from pathlib import Path
from unittest import mock
from uuid import UUID, uuid4

import pytest

from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.recorder.files.file_changes import FIRST_S, FileChanges
from robots.bridge.recorder.files.rounds import EVERY_S
from robots.shared.configuration.bridge_config import RecordingPlace


class Config:
    def __init__(self, directory: Path) -> None:
        self.recordings = RecordingPlace(str(directory), 10**9, 0)


class Records:
    """The records of a bridge whose database wants this."""

    def __init__(self) -> None:
        self.wanted: list[tuple[UUID, str]] = []
        self.done: list[tuple[UUID, str]] = []
        self.asked = 0

    def recording_changes(self, after: UUID | None, found) -> None:
        self.asked += 1
        found([one for one in sorted(self.wanted) if after is None or one[0] > after][:2])

    def recording_changed(self, recording: UUID, change: str) -> None:
        self.done.append((recording, change))


def files(directory: Path) -> list[str]:
    return sorted(path.suffix for path in directory.iterdir())


async def carried_out(changes: FileChanges, records: Records, now_s: float) -> None:
    before = len(records.done)
    changes.tick(now_s)
    while len(records.done) == before:  # noqa: ASYNC110
        await asyncio.sleep(0.005)


async def settled() -> None:
    """Wait until all pages are done."""
    await asyncio.sleep(0)  # the first page begins
    while works := asyncio.all_tasks() - {asyncio.current_task()}:
        await asyncio.wait(works)
        await asyncio.sleep(0)  # the next page begins


async def test_files_are_kept_let_go_and_removed(tmp_path: Path) -> None:
    recording, records = uuid4(), Records()
    path = tmp_path / f"20261102T090000Z-black_box-{recording}.mcap"
    for ending in (".mcap", ".jpg"):
        path.with_suffix(ending).write_bytes(b"x")
    changes = FileChanges(Config(tmp_path), records)
    changes.tick(0.0)
    for number, (change, left) in enumerate(
        (("keep", [".jpg", ".kept", ".mcap"]), ("let_go", [".jpg", ".mcap"]), ("remove", []))
    ):
        records.wanted = [(recording, change)]
        await carried_out(changes, records, FIRST_S + number * EVERY_S)
        assert files(tmp_path) == left
    assert [change for _, change in records.done] == ["keep", "let_go", "remove"]


async def test_only_what_is_here_is_reported(tmp_path: Path) -> None:
    """Another computer has the rest, or its disk is not mounted now."""
    records = Records()
    records.wanted = [(uuid4(), "remove") for _ in range(5)]
    here = max(recording for recording, _ in records.wanted)
    path = tmp_path / "recordings"
    changes = FileChanges(Config(path), records)
    changes.tick(0.0)
    changes.tick(FIRST_S)  # there is no directory
    await settled()
    path.mkdir()
    changes.tick(FIRST_S + EVERY_S)  # an empty one
    await settled()
    assert records.done == [] and records.asked == 1 + 4  # three pages, and the end
    (path / f"20261102T090000Z-black_box-{here}.mcap").write_bytes(b"x")
    await carried_out(changes, records, FIRST_S + 2 * EVERY_S)
    assert records.done == [(here, "remove")] and files(path) == []


def test_a_removal_that_was_interrupted_is_repeated(tmp_path: Path) -> None:
    recording, directory = uuid4(), RecordingDirectory(tmp_path, 10**9)
    path = tmp_path / f"20261102T090000Z-black_box-{recording}.mcap"
    for ending in (".mcap", ".jpg"):
        path.with_suffix(ending).write_bytes(b"x")
    unlink = Path.unlink

    def dies(one: Path, missing_ok: bool = False) -> None:
        if one.suffix == ".jpg":
            raise OSError
        unlink(one, missing_ok)

    with mock.patch.object(Path, "unlink", dies), pytest.raises(OSError):
        directory.remove(recording)
    assert directory.recordings() == {recording}
    directory.remove(recording)
    assert files(tmp_path) == []
