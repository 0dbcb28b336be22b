"""Files that people download: a whole recording, a cut in time, chosen topics; as MCAP, as a bag or for rosbag2.

A whole MCAP file is sent as it is, unless a person is in it who was erased. Everything else is made once, and stays for
some hours, so that a download can be continued. A part names nobody but who downloads it.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple
from uuid import UUID, uuid4

import msgspec
from django.conf import settings
from msgspec import Struct, structs

from fleet.accounts.models import User
from robots.recordings import stores
from robots.recordings.files.bag import NoBag, write_bag
from robots.recordings.files.contents import Contents, Unreadable
from robots.recordings.files.cutting import cut, topics_without_pictures
from robots.recordings.files.rosbag2 import for_rosbag2
from robots.recordings.services import taken_of
from robots.shared.records.record_sink import KeptEvent, TakenRecording
from robots.shared.wire import NotDone, Refusal
from teleop.recordings import times
from teleop.recordings.selectors import Sight

KEPT_S = 6 * 3600.0  # after its last use
IN_USE_S = 600.0  # after its last use it does not give way to another one
MOST_BYTES = 20 * 10**9  # of all such files
# Bytes of the disk that stay free beside those that recordings leave: else the downloads would end the recordings
RESERVE = 10**9
AT_ONCE = 2  # files that are made at the same time: each occupies a thread, and pages need threads, too
WAIT_S = 20.0

_BUSY = Refusal("busy", "Others download parts of recordings now: try again in a minute.", "limits")
_FULL = Refusal(
    "disk_full", "There is no room on the server for this download: download less of it.", "limits"
)
_EMPTY = Refusal("nothing_in_it", "The recording has no messages in this time and of these topics.", "wire")
_NO_BAG = {
    "bag": Refusal("no_bag", "A bag has messages of ROS 1 only: download this recording as MCAP.", "wire"),
    "rosbag2": Refusal(
        "no_bag", "rosbag2 reads messages of ROS 2 only: download this recording as MCAP or as a bag.", "wire"
    ),
}
UNREADABLE = Refusal("recording_unreadable", "The file of this recording cannot be read.", "robot")

_DRAFT = ".draft"  # before it stands how large the file may become
_making = threading.BoundedSemaphore(AT_ONCE)


FileFormat = Literal["mcap", "bag", "rosbag2"]
ENDINGS = {"mcap": "mcap", "bag": "bag", "rosbag2": "rosbag2.mcap"}


class Wanted(Struct, frozen=True):
    """The part that is downloaded. Times: s since the recording began; None: from its beginning, to its end."""

    format: FileFormat = "mcap"
    from_s: float | None = None
    until_s: float | None = None
    topics: list[str] | None = None  # None: all
    pictures: bool = True


class Download(NamedTuple):
    """A file, open for reading. With the same `version` it has the same bytes, so that a download can be continued."""

    file: BinaryIO
    version: str


def download(sight: Sight, wanted: Wanted, user: User) -> Download:
    """Return the file, made now if needed. Raises `NotDone`, `FileAway` or OSError."""
    recording = sight.recording
    if sight.whole and wanted == Wanted() and recording.stays is None:
        # Its size changes if a person who was erased is cut out of it
        return Download(stores.open_file(recording), f"{recording.pk}-{recording.bytes}")
    path = _made(sight, wanted, _about(sight, wanted, user))
    return Download(path.open("rb"), f"{path.stem}-{path.stat().st_mtime_ns:x}")


def _made(sight: Sight, wanted: Wanted, about: TakenRecording) -> Path:
    """Return the path of a part, made now if needed. Raises `NotDone` or `FileAway`."""
    recording = sight.recording
    parts = sorted(times.windows_ns(recording, sight.parts))
    asked = hashlib.sha256(msgspec.json.encode([wanted, parts, about])).hexdigest()[:20]
    folder = _folder()
    path = folder / f"{recording.pk}-{asked}.{ENDINGS[wanted.format]}"
    if path.exists():
        # The time of its last change stays: a browser continues only a file that did not change
        os.utime(path, ns=(time.time_ns(), path.stat().st_mtime_ns))
        return path
    if not _making.acquire(timeout=WAIT_S):
        raise NotDone(_BUSY)
    try:
        _make(sight, wanted, about, path)
    except Unreadable as error:
        raise NotDone(UNREADABLE) from error
    except NoBag as error:
        raise NotDone(_NO_BAG[wanted.format]) from error
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise NotDone(_FULL) from error
    finally:
        _making.release()
    return path


def name_of(sight: Sight, wanted: Wanted) -> str:
    """Return the name under which a browser saves it: robot and time, without what a person wrote."""
    recording = sight.recording
    part = "" if wanted == Wanted(wanted.format) and sight.whole else "-part"
    return f"{recording.robot.slug}-{recording.begins_at:%Y%m%dT%H%M%SZ}{part}.{ENDINGS[wanted.format]}"


def remove_old() -> None:
    """Remove files that nobody downloads any more."""
    for file in _files(_folder()):
        if file.used_s < time.time() - KEPT_S:
            file.path.unlink(missing_ok=True)


def remove_of(recording: UUID) -> None:
    """Remove what was made of a recording: a person is in it who was erased."""
    for path in _folder().glob(f"{recording}-*"):
        path.unlink(missing_ok=True)


def _make(sight: Sight, wanted: Wanted, about: TakenRecording, path: Path) -> None:
    with stores.open_file(sight.recording) as stream:
        contents = Contents(stream, sight.recording.pk)
        windows = times.windows_ns(sight.recording, sight.parts, wanted.from_s, wanted.until_s)
        topics = wanted.topics
        if not wanted.pictures:
            others = topics_without_pictures(contents)
            topics = others if topics is None else [topic for topic in topics if topic in others]
        needed = _needed(contents, wanted, windows)
        _make_room(path.parent, needed)
        draft = path.with_name(f"{uuid4()}.{needed}{_DRAFT}")
        try:
            if wanted.format == "bag":
                count = write_bag(contents, draft, topics=topics, windows=windows)
            else:
                more = {"shape": for_rosbag2} if wanted.format == "rosbag2" else {}
                with draft.open("xb") as file:
                    count = cut(contents, file, topics=topics, windows=windows, about=about, **more)
            if not count:
                raise NotDone(_EMPTY)
            draft.rename(path)
        finally:
            draft.unlink(missing_ok=True)


def _about(sight: Sight, wanted: Wanted, user: User) -> TakenRecording:
    """Return what a file that is made for this person says of itself."""
    recording = sight.recording
    events = msgspec.convert(sight.events, list[KeptEvent])
    told = structs.replace(taken_of(recording), directory="", events=events)
    if sight.whole and wanted.from_s is None and wanted.until_s is None:
        return told
    windows = times.windows_ns(recording, sight.parts, wanted.from_s, wanted.until_s) or [(0, 0)]
    told = structs.replace(
        told,
        begins=windows[0][0] / 1e9,
        ends=windows[-1][1] / 1e9,
        bytes=0,
        name="",
        topics=[],
        controls=None,
        events=[
            event if event.by in ("", user.display_name) else structs.replace(event, by="", text="")
            for event in events
            if any(begin <= event.at * 1e9 < end for begin, end in windows)
        ],
    )
    if recording.person_id == user.pk:
        return told
    return structs.replace(told, person="", session="", booking="", reason="")


# --- the folder ------------------------------------------------------------------------------------


class _File(NamedTuple):
    """A file of the folder."""

    used_s: float  # the time of its last use
    path: Path
    bytes: int
    promised: int  # bytes that will be written, too: it is a draft


def _needed(contents: Contents, wanted: Wanted, windows: list[tuple[int, int]]) -> int:
    """Return how large a file becomes at most, roughly. A bag is not compressed, and its messages are longer."""
    chunks = [
        chunk
        for chunk in contents.summary.chunk_indexes
        if any(chunk.message_start_time < last and chunk.message_end_time >= first for first, last in windows)
    ]
    if wanted.format != "bag":
        return sum(chunk.compressed_size for chunk in chunks) * 5 // 4
    share = len(chunks) / max(len(contents.summary.chunk_indexes), 1)
    return sum(chunk.uncompressed_size for chunk in chunks) + round(share * contents.messages_count * 64)


def _make_room(folder: Path, needed: int) -> None:
    """Make room for a file: those that were used longest ago go first. Raises `NotDone`."""
    files = sorted(_files(folder))
    promised = sum(one.promised for one in files)
    least_free = settings.FLEET_RECORDINGS_FREE_BYTES + RESERVE
    free = shutil.disk_usage(folder).free - least_free - promised
    used = sum(one.bytes for one in files) + promised
    missing = max(needed - free, used + needed - MOST_BYTES)
    idle = [one for one in files if not one.promised and one.used_s < time.time() - IN_USE_S]
    if missing > sum(one.bytes for one in idle):
        raise NotDone(_FULL)
    for one in idle:
        if missing > 0:
            one.path.unlink(missing_ok=True)
            missing -= one.bytes


def _files(folder: Path) -> list[_File]:
    files = []
    for path in folder.iterdir():
        with suppress(FileNotFoundError):  # it was finished or removed meanwhile
            about = path.stat()
            promised = path.stem.rpartition(".")[2] if path.suffix == _DRAFT else ""
            left = int(promised) - about.st_size if promised.isdecimal() else 0
            files.append(_File(max(about.st_atime, about.st_mtime), path, about.st_size, max(left, 0)))
    return files


def _folder() -> Path:
    folder: Path = settings.FLEET_VAR / "downloads"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder
