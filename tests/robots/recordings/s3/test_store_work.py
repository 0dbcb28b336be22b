"""Recordings move into the object store, whatever breaks meanwhile, and are removed from it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import astuple
from datetime import timedelta
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from django.core.management import CommandError, call_command
from django.utils import timezone

from robots.bridge.recorder.erasing.__main__ import cut_file
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.recordings import services, stores
from robots.recordings.files.contents import Contents
from robots.recordings.models import Place, Recording
from robots.recordings.s3 import store_work
from robots.recordings.s3.bucket import StoreAway
from robots.recordings.s3.store_work import StoreWork, work
from robots.recordings.s3.upload import PART_BYTES, Later
from robots.registry.models import Robot
from tests.processes import REPOSITORY
from tests.robots.recordings.s3.storage import Request, Storage, _storage, s3
from tests.robots.recordings.samples import SECOND, sample

pytestmark = pytest.mark.django_db
__all__ = ["_storage", "s3"]

UPLOAD = """
import json, sys
from pathlib import Path
from fleet.base.environment import ObjectStore
from robots.recordings.s3.bucket import Bucket
from robots.recordings.s3.upload import upload
store, path, key = json.loads(sys.argv[1])
upload(Bucket(ObjectStore(*store), 20.0), Path(path), key, lambda: True)
"""


def _data(size: int) -> bytes:
    return bytes(range(251)) * (size // 251) + bytes(size % 251)


class Computer:
    """A computer with recordings, and its store process."""

    def __init__(self, s3: Storage, robot: Robot, folder: Path) -> None:
        self.s3, self.robot = s3, robot
        self.files = RecordingDirectory(folder, 10**9)
        self.ended = threading.Event()
        self.folder = folder.with_name("while they are cut")
        self.work = StoreWork(s3.store, self.files, self.ended, self.folder, cut_file)

    def record(self, data: bytes, **given: Any) -> Recording:
        """A finished recording with its row and a small picture."""
        number, now = uuid4(), timezone.now()
        path = self.files.path / f"20261102T090000Z-by_hand-{number}.mcap"
        path.write_bytes(data)
        path.with_suffix(".jpg").write_bytes(b"picture")
        return Recording.objects.create(
            pk=number,
            robot=self.robot,
            kind="by_hand",
            begins_at=now - timedelta(seconds=10),
            ends_at=now,
            directory=str(self.files.path),
            file=path.name,
            bytes=len(data),
            thumbnail=True,
            **given,
        )

    def path(self, recording: Recording) -> Path:
        return self.files.path / recording.file

    @property
    def left(self) -> list[str]:
        return sorted(path.name for path in self.files.path.iterdir() if path.name != store_work.LOCK)


@pytest.fixture
def computer(s3: Storage, robot: Robot, tmp_path: Path, settings: Any) -> Computer:
    settings.FLEET_S3 = s3.store
    return Computer(s3, robot, tmp_path)


def test_a_finished_file_moves_with_its_picture_and_the_row_follows(computer: Computer, s3: Storage) -> None:
    data = _data(100_000)
    recording = computer.record(data)
    (computer.files.path / f"20261102T090000Z-by_hand-{uuid4()}.part").write_bytes(b"is written")
    told_later = f"20261102T090000Z-by_hand-{uuid4()}.mcap"
    (computer.files.path / told_later).write_bytes(b"has no row yet")
    computer.work.work_once()
    recording.refresh_from_db()
    assert (recording.place, recording.file) == (Place.S3, "")
    assert sorted(Path(name).suffix for name in computer.left) == [".mcap", ".part"]
    assert told_later in computer.left
    assert (
        all(key.startswith("lab/20261102T090000Z-by_hand-") for key in s3.objects())
        and len(s3.objects()) == 2
    )
    with stores.open_file(recording) as file, stores.open_thumbnail(recording) as picture:
        assert file.read() == data and picture.read() == b"picture"
        file.seek(-10, os.SEEK_END)
        assert file.read(99) == data[-10:] and file.read() == b""
    before = len(s3.requests)
    left = computer.files.path / f"20261102T090000Z-by_hand-{recording.pk}.mcap"
    left.write_bytes(data)  # as if the process had been killed before it removed the file
    computer.work.work_once()
    assert len(s3.requests) == before and not left.exists()


def test_a_killed_upload_goes_on_without_the_parts_it_sent(computer: Computer, s3: Storage) -> None:
    data = _data(2 * PART_BYTES + 1000)
    recording = computer.record(data)
    path, held, killed = computer.path(recording), threading.Event(), threading.Event()

    def hold(request: Request) -> tuple[int, str] | None:
        if request.part != 2:
            return None
        held.set()
        killed.wait(20.0)
        return 500, "TooLate"

    key = f"lab/{path.stem}.{path.stat().st_mtime_ns:x}.mcap"
    s3.fault = hold
    asked = json.dumps([astuple(s3.store), str(path), key])
    process = subprocess.Popen([sys.executable, "-c", UPLOAD, asked], cwd=REPOSITORY)
    assert held.wait(20.0)
    process.send_signal(signal.SIGKILL)
    process.wait()
    killed.set()
    assert s3.parts == [1, 2] and s3.objects() == []
    s3.fault = lambda _: None
    computer.work.work_once()
    assert s3.parts == [1, 2, 2, 3]
    recording.refresh_from_db()
    assert recording.place == Place.S3 and s3.uploads() == []
    with stores.open_file(recording) as file:
        assert file.read() == data


def test_a_store_that_answers_503_gets_the_file_later(
    computer: Computer, s3: Storage, caplog: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_work, "close_old_connections", lambda: None)  # the test's own
    monkeypatch.setattr(store_work, "EVERY_S", 0.01)
    monkeypatch.setattr(store_work, "LONGEST_S", 0.02)
    recording = computer.record(_data(PART_BYTES + 1000))
    refused: list[Request] = []

    def busy(request: Request) -> tuple[int, str] | None:
        if request.part != 2 or len(refused) >= 5:
            return None
        refused.append(request)
        return 503, "SlowDown"

    s3.fault = busy
    rounds = iter(range(200))
    ended = computer.ended
    ended.wait = lambda _s: next(rounds) > 50 or not computer.path(recording).exists()  # type: ignore[method-assign]
    work(s3.store, computer.files, ended, computer.folder, cut_file)
    recording.refresh_from_db()
    assert recording.place == Place.S3 and s3.parts == [1, *[2] * 6]
    assert caplog.text.count("tried again") == 1 and "503 SlowDown" in caplog.text
    assert caplog.text.count("takes recordings again") == 1


def test_what_arrived_otherwise_is_sent_again_and_the_file_stays(computer: Computer, s3: Storage) -> None:
    data = _data(5000)
    recording = computer.record(data)
    path = computer.path(recording)
    key = f"lab/{path.stem}.{path.stat().st_mtime_ns:x}.mcap"
    s3.ask("put_object", Key=key, Body=data[:-1] + b"?")
    with pytest.raises(Later, match="was not the file"):
        computer.work.work_once()
    recording.refresh_from_db()
    assert recording.place == Place.DIRECTORY and path.exists()
    computer.work.work_once()
    recording.refresh_from_db()
    assert recording.place == Place.S3
    # A store that encrypts has other tags: then the bytes count
    s3.ask("put_object", Key=key, Body=data)
    path.write_bytes(data)
    os.utime(path, ns=(0, int(key.split(".")[-2], 16)))
    Recording.objects.update(place=Place.DIRECTORY, file=path.name)
    s3.requests.clear()
    computer.work.work_once()
    recording.refresh_from_db()
    assert recording.place == Place.S3 and s3.parts == []


def test_objects_of_deleted_recordings_are_removed_when_possible(computer: Computer, s3: Storage) -> None:
    stored, begun = computer.record(b"stored" * 100), computer.record(b"begun" * 100)
    computer.files.remove(begun.pk)  # it was deleted when its upload had begun
    computer.work.work_once()
    key = f"lab/{begun.file}"
    s3.ask("create_multipart_upload", Key=key)
    services.object_begins(begun.pk, key)
    Recording.objects.update(place=Place.GONE)
    s3.fault = lambda request: (503, "SlowDown") if request.method == "DELETE" else None
    with pytest.raises(StoreAway):
        computer.work.work_once()
    s3.fault = lambda _: None
    assert len(s3.objects()) == 2 and len(s3.uploads()) == 1
    computer.work.work_once()
    assert s3.objects() == [] and s3.uploads() == [] and services.objects_to_remove() == []
    assert set(Recording.objects.values_list("pk", "object")) == {(stored.pk, ""), (begun.pk, "")}


def test_a_recording_that_is_deleted_during_its_upload_leaves_nothing(
    computer: Computer, s3: Storage
) -> None:
    recording = computer.record(b"x" * 100)

    upload = store_work.upload

    def beside_another_process(*arguments: Any) -> None:
        Recording.objects.filter(pk=recording.pk).update(place=Place.GONE)
        StoreWork(s3.store, None, computer.ended, computer.folder, cut_file).work_once()
        assert services.objects_to_remove() == []
        upload(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_work, "upload", beside_another_process)
        computer.work.work_once()
    recording.refresh_from_db()
    assert (recording.place, recording.object) == (Place.GONE, "") and s3.objects() == []
    assert computer.path(recording).exists(), "the bridge removes it"


def test_erased_people_are_cut_out_of_objects_whatever_breaks(computer: Computer, s3: Storage) -> None:
    recording = computer.record(sample(10, holder="Olga").getvalue())
    computer.work.work_once()
    [before, *_] = [key for key in s3.objects() if key.endswith(".mcap")]
    Recording.objects.update(stays=[[0, 5 * SECOND]])

    for broken in ("POST", "DELETE"):  # before the new object is whole; before the old one is gone
        s3.fault = lambda request, broken=broken: (503, "SlowDown") if request.method == broken else None
        with pytest.raises(StoreAway):
            computer.work.work_once()
        recording.refresh_from_db()
        assert recording.stays and not computer.folder.exists() and before in s3.objects()
    s3.fault = lambda _: None
    s3.requests.clear()
    computer.work.work_once()
    recording.refresh_from_db()
    assert recording.stays is None and s3.parts == [], "it was cut before"
    assert recording.place == Place.S3 and before not in s3.objects() and s3.uploads() == []
    with stores.open_file(recording) as file:
        data = file.read()
        contents = Contents(file)
    assert b"Olga" not in data and len(data) == recording.bytes and contents.ends_ns < 5 * SECOND
    Recording.objects.update(stays=[])
    computer.work.work_once()
    recording.refresh_from_db()
    computer.work.work_once()
    assert recording.place == Place.GONE and s3.objects() == []


def test_a_file_that_must_be_cut_is_not_uploaded(computer: Computer, s3: Storage) -> None:
    recording = computer.record(_data(500), stays=[[0, 5]])
    computer.work.work_once()
    assert s3.objects() == []
    Recording.objects.update(stays=None)

    def then_one_is_erased(*arguments: Any) -> None:
        upload(*arguments)
        Recording.objects.update(stays=[[0, 5]])

    upload = store_work.upload
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_work, "upload", then_one_is_erased)
        computer.work.work_once()
    recording.refresh_from_db()
    path = computer.path(recording)
    assert recording.place == Place.DIRECTORY and len(s3.objects()) == 2
    path.write_bytes(_data(300))  # the bridge has cut it
    Recording.objects.update(stays=None)
    computer.work.work_once()
    recording.refresh_from_db()
    assert recording.place == Place.S3 and len(s3.objects()) == 2
    with stores.open_file(recording) as file:
        assert file.read() == _data(300)


def test_one_process_uploads_from_a_folder(computer: Computer, s3: Storage) -> None:
    computer.record(b"x" * 100)
    lock = store_work._sole(computer.files.path)
    assert lock is not None
    computer.work.work_once()
    assert s3.objects() == []
    lock.close()
    computer.work.work_once()
    assert len(s3.objects()) == 2


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ((403, "InvalidAccessKeyId"), "FLEET_S3_KEY"),
        ((403, "SignatureDoesNotMatch"), "FLEET_S3_SECRET"),
        ((403, "AccessDenied"), "may not read, write, list and delete"),
        ((400, "AuthorizationHeaderMalformed"), "FLEET_S3_REGION"),
        ((503, "SlowDown"), "503 SlowDown"),
    ],
)
def test_the_check_says_what_is_wrong(
    fault: tuple[int, str], words: str, s3: Storage, settings: Any, capsys: Any
) -> None:
    settings.FLEET_S3 = s3.store
    s3.fault = lambda _: fault
    with pytest.raises(CommandError, match=words) as said:
        call_command("check_store")
    assert "s3cret" not in str(said.value) + repr(s3.store)


def test_the_check_of_a_store_that_works_and_of_a_missing_bucket(
    s3: Storage, settings: Any, capsys: Any
) -> None:
    settings.FLEET_S3 = s3.store
    call_command("check_store")
    assert "takes, gives and removes" in capsys.readouterr().out and s3.objects() == []
    strange = f"lab/20261102T090000Z-by_hand-{uuid4()}.1a2b.mcap"
    for key in (strange, "lab/notes.txt"):
        s3.ask("put_object", Key=key, Body=b"")
    call_command("check_store")
    assert "belong to no recording: 1. --remove" in capsys.readouterr().out
    call_command("check_store", "--remove")
    assert s3.objects() == ["lab/notes.txt"]
    s3.ask("delete_object", Key="lab/notes.txt")
    s3.ask("delete_bucket")
    with pytest.raises(CommandError, match=f"no bucket {s3.store.bucket}"):
        call_command("check_store")
    settings.FLEET_S3 = None
    with pytest.raises(CommandError, match="FLEET_S3_URL is not set"):
        call_command("check_store")
