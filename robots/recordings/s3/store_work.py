"""The work of the store process: it removes objects of deleted recordings, and uploads finished files one at a time.

It also cuts people who were erased out of objects.

What it did is in the rows and in the store, so it may be killed at any moment, and several may run.
"""

from __future__ import annotations

import fcntl
import logging
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Protocol
from uuid import UUID

from django.db import DatabaseError, close_old_connections

from fleet.base.environment import ObjectStore
from robots.recordings import services
from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import PICTURE, Bucket, StoreAway, key_of, picture_of
from robots.recordings.s3.object_cuts import Cutter, ObjectCuts
from robots.recordings.s3.upload import Damaged, Interrupted, Later, forget, upload

log = logging.getLogger(__name__)

EVERY_S = 15.0
LONGEST_S = 300.0  # between two tries while the store does not do what it is asked
PATIENCE_S = 60.0
LOCK = ".upload.lock"  # in the folder


class FinishedFile(Protocol):
    """A finished recording in the folder."""

    @property
    def path(self) -> Path: ...
    @property
    def recording(self) -> UUID: ...


class Files(Protocol):
    """The folder of recordings on this computer (`RecordingDirectory`)."""

    path: Path

    def entries(self) -> Sequence[FinishedFile]: ...
    def remove(self, recording: UUID) -> None: ...


def work(
    store: ObjectStore, files: Files | None, ended: threading.Event, folder: Path, cut_file: Cutter
) -> None:
    """Work until `ended`. A store that is away is tried again, with growing pauses, and told once.

    `folder`: for files while `cut_file` cuts them.
    """
    process = StoreWork(store, files, ended, folder, cut_file)
    trouble, pause_s = "", 0.0
    while not ended.wait(pause_s):
        said, pause_s = "", EVERY_S if not trouble else min(2 * pause_s, LONGEST_S)
        try:
            process.work_once()
        except Interrupted:
            return
        except (StoreAway, Later, DatabaseError, OSError) as error:
            said = str(error)
        finally:
            close_old_connections()
        if said and said != trouble:
            log.warning("Recordings wait for the object store, and are tried again: %s", said)
        elif trouble and not said:
            log.info("The object store takes recordings again.")
            pause_s = EVERY_S
        trouble = said


class StoreWork:
    """The work of one process. `files` None: this computer keeps no recordings."""

    def __init__(
        self,
        store: ObjectStore,
        files: Files | None,
        ended: threading.Event,
        folder: Path,
        cut_file: Cutter,
    ) -> None:
        self._bucket = Bucket(store, PATIENCE_S)
        self._prefix = store.prefix
        self._files = files
        self._ended = ended
        self._cuts = ObjectCuts(self._bucket, store.prefix, folder, cut_file, self._goes_on)

    def _goes_on(self) -> bool:
        return not self._ended.is_set()

    def work_once(self) -> None:
        """Do what is to do now, the oldest first.

        Raises `StoreAway`, `Later`, `Interrupted`, DatabaseError or OSError.
        """
        self._remove()
        self._cuts.work_once()
        if self._files is None or (lock := _sole(self._files.path)) is None:
            return
        failed = []
        with lock:
            for file in self._files.entries():
                try:
                    self._move(self._files, file)
                except FileNotFoundError:  # it was deleted meanwhile
                    continue
                except (OSError, Damaged) as error:
                    failed.append(f"{file.recording}: {error}")
                self._remove()
        if failed:
            raise Later(", ".join(failed))

    def _move(self, files: Files, file: FinishedFile) -> None:
        """Move a file into the store. One that was moved, and not removed here before a crash, is removed."""
        row = Recording.objects.filter(pk=file.recording).only("place", "file", "object").first()
        if row is None or (row.place == Place.GONE and row.file):  # the bridge will report, or remove it
            return
        if row.place != Place.DIRECTORY or self._upload(row, file.path):
            files.remove(file.recording)

    def _upload(self, row: Recording, path: Path) -> bool:
        """Upload a file. Return whether its place is the store now."""
        key = key_of(self._prefix, path)
        if row.object not in ("", key):  # the file has changed since
            forget(self._bucket, row.object)
        if not services.object_begins(row.pk, key):
            return False
        picture = path.with_suffix(PICTURE)
        if picture.exists():
            self._bucket.put(picture_of(key), picture.read_bytes())
        upload(self._bucket, path, key, self._goes_on)
        return key_of(self._prefix, path) == key and services.object_stored(row.pk, key)

    def _remove(self) -> None:
        for recording, key in services.objects_to_remove():
            forget(self._bucket, key)
            services.object_removed(recording, key)


def _sole(folder: Path) -> IO[str] | None:
    """Lock the folder, which several computers may mount. None: another process uploads, or nothing is there."""
    try:
        lock = (folder / LOCK).open("w")
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return lock
