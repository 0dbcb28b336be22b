"""The saved state survives a kill."""

import errno
import os
import stat
from unittest.mock import patch

import pytest

from robots.bridge.lease.state_store import AlreadyRunning, SavedState, StateStore
from robots.shared.sentences import say


@pytest.fixture
def store(tmp_path):
    return StateStore(tmp_path, "robot")


def test_latch_and_number_come_back(store):
    store.save(SavedState(True, "Ann", say("{reason}.", reason="why"), 7))
    assert store.load(0) == SavedState(True, "Ann", "why.", 7)


def test_a_robot_that_was_never_driven_starts_clear(store):
    assert store.load(0) == SavedState(False, "", "", 0)


def test_a_lost_file_counts_as_a_pressed_stop(store):
    left = store.load(last_fence=12)
    assert left.latched
    assert left.fence == 12
    assert "missing" in left.reason


@pytest.mark.parametrize("content", [b'{"latched": false', b'{"latched": false, "by": "\xff"}'])
def test_a_spoilt_file_counts_as_a_pressed_stop(store, tmp_path, content):
    (tmp_path / "robot.json").write_bytes(content)
    assert store.load(3).latched


def test_the_highest_number_that_either_side_knows_counts(store):
    store.save(SavedState(False, "", "", 7))
    assert store.load(9).fence == 9
    assert store.load(2).fence == 7


def test_unwritable_stop_removes_the_state_file(store, tmp_path):
    store.save(SavedState(False, "", "", 7))
    (tmp_path / "robot.new").mkdir()  # writing fails
    with pytest.raises(OSError, match="directory"):
        store.save(SavedState(True, "Ann", "", 7))
    assert store.load(7).latched


def test_saved_state_survives_a_power_cut(store, tmp_path):
    """The content is on disk before the file gets its name; the name is on disk when `save` returns."""
    synced = []

    def fsync(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        synced.append((is_folder, (tmp_path / "robot.json").exists()))

    with patch.object(os, "fsync", fsync):
        store.save(SavedState(True, "Ann", "", 7))
    assert synced == [(False, False), (True, True)]


def test_stop_with_failed_folder_sync_removes_the_file(store):
    store.save(SavedState(False, "", "", 7))
    with (
        patch.object(os, "fsync", side_effect=[None, OSError(5, "I/O error")]),
        pytest.raises(OSError, match="I/O"),
    ):
        store.save(SavedState(True, "Ann", "", 7))
    assert "missing" in store.load(7).reason


def test_a_folder_that_cannot_be_synced_takes_nothing_away(store):
    with patch.object(os, "fsync", side_effect=[None, OSError(errno.EINVAL, "Invalid argument")]):
        store.save(SavedState(True, "Ann", "smoke", 7))
    assert store.load(7) == SavedState(True, "Ann", "smoke", 7)


def test_a_second_bridge_on_this_machine_is_refused(store, tmp_path):
    store.lock()
    with pytest.raises(AlreadyRunning):
        StateStore(tmp_path, "robot").lock()
    store.unlock()
    again = StateStore(tmp_path, "robot")
    again.lock()
    again.unlock()
