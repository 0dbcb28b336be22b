"""Decisions about finished files, carried out on the bridge's computer."""

from __future__ import annotations

import asyncio
from pathlib import Path
from uuid import UUID, uuid4

from robots.bridge.recorder.files.file_changes import EVERY_S, FIRST_S, FileChanges
from robots.shared.configuration.bridge_config import RecordingPlace


class Config:
    def __init__(self, directory: Path) -> None:
        self.recordings = RecordingPlace(str(directory), 10**9, 0)


class Records:
    """The records of a bridge whose database wants one change at a time."""

    def __init__(self) -> None:
        self.wanted: list[tuple[UUID, str]] = []
        self.done: list[tuple[UUID, str]] = []

    def recording_changes(self, found) -> None:
        found(list(self.wanted))

    def recording_changed(self, recording: UUID, change: str) -> None:
        self.done.append((recording, change))


def files(directory: Path) -> list[str]:
    return sorted(path.suffix for path in directory.iterdir())


async def carried_out(changes: FileChanges, records: Records, now_s: float) -> None:
    before = len(records.done)
    changes.tick(now_s)
    while len(records.done) == before:  # noqa: ASYNC110
        await asyncio.sleep(0.005)


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


async def test_a_disk_that_is_gone_is_asked_again(tmp_path: Path) -> None:
    recording, records = uuid4(), Records()
    path = tmp_path / "away"
    changes = FileChanges(Config(path), records)
    changes.tick(0.0)
    records.wanted = [(recording, "remove")]
    changes.tick(FIRST_S)
    await asyncio.sleep(0)
    path.mkdir()
    await carried_out(changes, records, FIRST_S + EVERY_S)
    assert records.done[-1] == (recording, "remove")
