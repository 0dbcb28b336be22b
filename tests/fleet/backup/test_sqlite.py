"""Copies of a SQLite database in use."""

from __future__ import annotations

import resource
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from fleet.backup.sqlite import copy_database, damage, is_used


@pytest.fixture
def live(tmp_path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(tmp_path / "live", isolation_level=None)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("CREATE TABLE word (text)")
    return connection


def test_a_copy_has_what_is_committed_while_a_writer_writes(tmp_path: Path, live: sqlite3.Connection) -> None:
    live.execute("INSERT INTO word VALUES ('committed')")
    live.execute("BEGIN IMMEDIATE")
    live.execute("INSERT INTO word VALUES ('not yet')")
    copy_database(tmp_path / "live", tmp_path / "copy")
    live.execute("COMMIT")
    live.close()
    with closing(sqlite3.connect(tmp_path / "copy")) as copy:
        assert copy.execute("SELECT text FROM word").fetchall() == [("committed",)]
    assert (tmp_path / "copy").stat().st_mode & 0o777 == 0o600
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy", "live"]
    assert not damage(tmp_path / "copy")


def test_a_full_disk_leaves_no_half_copy(tmp_path: Path, live: sqlite3.Connection) -> None:
    live.execute("INSERT INTO word VALUES (?)", ["x" * 1_000_000])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises((sqlite3.Error, OSError)):
            copy_database(tmp_path / "live", tmp_path / "copy")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    live.close()
    assert [path.name for path in tmp_path.iterdir()] == ["live"]


def test_an_open_connection_is_noticed(tmp_path: Path, live: sqlite3.Connection) -> None:
    assert is_used(tmp_path / "live")
    live.close()
    assert not is_used(tmp_path / "live")
