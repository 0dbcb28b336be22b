"""Takes people who were erased out of objects: each is fetched, cut on this computer, and replaced by another object.

Until the earlier object is removed, the row says what must be cut. So each step is repeated after a crash, and a file
that was cut already tells so (`cut_file`).
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mcap.exceptions import McapError
from msgspec import structs

from robots.recordings import services
from robots.recordings.file_cuts import file_cut, file_cuts
from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import PICTURE, Bucket, NotThere, family_of, key_of, name_of, picture_of
from robots.recordings.s3.upload import PART_BYTES, Damaged, Interrupted, Later, forget_others, upload
from robots.shared.records.record_sink import FileCut, TakenRecording

LEAST_FREE = 10**9  # bytes that the old and the new file leave free

Cutter = Callable[[FileCut], TakenRecording]  # cuts a file in `taken.directory`; returns what it is then


class ObjectCuts:
    """The cuts of one process. `folder`: for files while they are cut; nothing else is there."""

    def __init__(
        self, bucket: Bucket, prefix: str, folder: Path, cut_file: Cutter, goes_on: Callable[[], bool]
    ) -> None:
        self._bucket, self._prefix = bucket, prefix
        self._folder = folder
        self._cut_file = cut_file
        self._goes_on = goes_on

    def work_once(self) -> None:
        """Cut what is to be cut. Raises `Later`, `StoreAway`, `Interrupted` or DatabaseError."""
        failed = []
        for cut in file_cuts(place=Place.S3):
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(mode=0o700)
            try:
                self._cut(cut)
            except (Damaged, McapError, OSError) as error:
                failed.append(f"{cut.taken.recording}: {error}")
            finally:
                shutil.rmtree(self._folder, ignore_errors=True)
        if failed:
            raise Later(", ".join(failed))

    def _cut(self, cut: FileCut) -> None:
        row = Recording.objects.filter(pk=cut.taken.recording, place=Place.S3).only("object").first()
        if row is None:  # it was deleted meanwhile
            return
        key, path = row.object, self._fetched(row.object, cut.taken.thumbnail)
        before = key_of(self._prefix, path)
        here = structs.replace(cut.taken, directory=str(self._folder), name=path.name)
        taken = self._cut_file(structs.replace(cut, taken=here))
        if taken.bytes and (new := key_of(self._prefix, path)) != before:
            if not self._replaced(row, path, new):
                return
            key = new
        if taken.bytes:
            forget_others(self._bucket, family_of(key), (key, picture_of(key)))
        file_cut(structs.replace(cut, taken=structs.replace(taken, directory=cut.taken.directory, name="")))

    def _fetched(self, key: str, has_picture: bool) -> Path:
        """Fetch an object and its picture."""
        path = self._folder / name_of(key)
        found = self._bucket.find(key)
        if shutil.disk_usage(self._folder).free < 2 * found.bytes + LEAST_FREE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        with path.open("xb") as file:
            while (at := file.tell()) < found.bytes:
                if not self._goes_on():
                    raise Interrupted
                file.write(self._bucket.read(key, at, min(PART_BYTES, found.bytes - at), found.tag))
        if has_picture:
            with suppress(NotThere):
                path.with_suffix(PICTURE).write_bytes(self._bucket.read(picture_of(key)))
        return path

    def _replaced(self, row: Recording, path: Path, key: str) -> bool:
        """Upload what stays, and let the row name it. Return False if it was deleted, or cut by another computer."""
        picture = path.with_suffix(PICTURE)
        if picture.exists():
            self._bucket.put(picture_of(key), picture.read_bytes())
        upload(self._bucket, path, key, self._goes_on)
        if services.object_replaced(row.pk, row.object, key):
            return True
        self._bucket.remove(key)
        self._bucket.remove(picture_of(key))
        return False
