"""Files that people download: a whole recording, a cut in time, chosen topics; as MCAP or as a bag.

A whole MCAP file is sent as it is. Everything else is made once, and stays for some hours, so that a download can be
continued.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple
from uuid import uuid4

import msgspec
from django.conf import settings
from msgspec import Struct, structs

from robots.recordings import stores
from robots.recordings.files.bag import NoBag, write_bag
from robots.recordings.files.contents import Contents, Unreadable
from robots.recordings.files.cutting import cut, topics_without_pictures
from robots.recordings.services import taken_of
from robots.shared.records.record_sink import KeptEvent, TakenRecording
from robots.shared.wire import NotDone, Refusal
from teleop.recordings.replay import windows_ns
from teleop.recordings.selectors import Sight

KEPT_S = 6 * 3600.0
LEAST_FREE = 1024 * 1024 * 1024  # bytes of the disk that stay free
AT_ONCE = 2  # files that are made at the same time: each occupies a thread, and pages need threads, too
WAIT_S = 20.0

_BUSY = Refusal("busy", "Others download parts of recordings now: try again in a minute.", "limits")
_FULL = Refusal(
    "disk_full", "There is no room on the server for this download: download less of it.", "limits"
)
_EMPTY = Refusal("nothing_in_it", "The recording has no messages in this time and of these topics.", "wire")
_NO_BAG = Refusal("no_bag", "A bag has messages of ROS 1 only: download this recording as MCAP.", "wire")
UNREADABLE = Refusal("recording_unreadable", "The file of this recording cannot be read.", "robot")

_making = threading.BoundedSemaphore(AT_ONCE)


class Wanted(Struct, frozen=True):
    """The part that is downloaded. Times: s since the recording began; None: from its beginning, to its end."""

    format: Literal["mcap", "bag"] = "mcap"
    from_s: float | None = None
    until_s: float | None = None
    topics: list[str] | None = None  # None: all
    pictures: bool = True


class Download(NamedTuple):
    """A file, open for reading. With the same `version` it has the same bytes, so that a download can be continued."""

    file: BinaryIO
    version: str


def download(sight: Sight, wanted: Wanted) -> Download:
    """Return the file, made now if needed. Raises `NotDone`, `FileAway` or OSError."""
    if sight.whole and wanted == Wanted():
        return Download(stores.open_file(sight.recording), str(sight.recording.pk))
    path = _made(sight, wanted)
    return Download(path.open("rb"), f"{path.stem}-{path.stat().st_mtime_ns:x}")


def _made(sight: Sight, wanted: Wanted) -> Path:
    """Return the path of a part, made now if needed. Raises `NotDone` or `FileAway`."""
    recording = sight.recording
    parts = sorted(windows_ns(sight))
    asked = hashlib.sha256(msgspec.json.encode([wanted, parts, _about(sight)])).hexdigest()[:20]
    folder = _folder()
    path = folder / f"{recording.pk}-{asked}.{wanted.format}"
    if path.exists():
        os.utime(path)
        return path
    if shutil.disk_usage(folder).free < recording.bytes + LEAST_FREE:
        raise NotDone(_FULL)
    if not _making.acquire(timeout=WAIT_S):
        raise NotDone(_BUSY)
    draft = folder / f"{uuid4()}.draft"
    try:
        _make(sight, wanted, draft)
        draft.rename(path)
    except Unreadable as error:
        raise NotDone(UNREADABLE) from error
    except NoBag as error:
        raise NotDone(_NO_BAG) from error
    finally:
        _making.release()
        draft.unlink(missing_ok=True)
    return path


def name_of(sight: Sight, wanted: Wanted) -> str:
    """Return the name under which a browser saves it: robot and time, without what a person wrote."""
    recording = sight.recording
    part = "" if wanted == Wanted(wanted.format) and sight.whole else "-part"
    return f"{recording.robot.slug}-{recording.begins_at:%Y%m%dT%H%M%SZ}{part}.{wanted.format}"


def remove_old(now_s: float | None = None) -> Iterator[None]:
    """Remove files that nobody downloads any more, one at each step."""
    now_s = time.time() if now_s is None else now_s
    for path in _folder().iterdir():
        with suppress(FileNotFoundError):  # it was finished or removed meanwhile
            if path.stat().st_mtime < now_s - KEPT_S:
                path.unlink()
        yield


def _make(sight: Sight, wanted: Wanted, target: Path) -> None:
    with stores.open_file(sight.recording) as stream:
        contents = Contents(stream, sight.recording.pk)
        topics = wanted.topics
        if not wanted.pictures:
            others = topics_without_pictures(contents)
            topics = others if topics is None else [topic for topic in topics if topic in others]
        if wanted.format == "mcap":
            with target.open("xb") as file:
                windows = _windows(sight, wanted)
                count = cut(contents, file, topics=topics, windows=windows, about=_about(sight))
        else:
            count = write_bag(contents, target, topics=topics, windows=_windows(sight, wanted))
    if not count:
        raise NotDone(_EMPTY)


def _about(sight: Sight) -> TakenRecording:
    """Return what a file that is made for this person says of itself: what the person is told of the recording."""
    told = structs.replace(
        taken_of(sight.recording), directory="", events=msgspec.convert(sight.events, list[KeptEvent])
    )
    return told if sight.tells_owner else structs.replace(told, person="", session="", reason="")


def _windows(sight: Sight, wanted: Wanted) -> list[tuple[int, int]]:
    """Return what the person sees of the time that is wanted, in ns."""
    began_ns = round(sight.recording.begins_at.timestamp() * 1e6) * 1000
    begin = began_ns + round(wanted.from_s * 1e9) if wanted.from_s is not None else 0
    end = began_ns + round(wanted.until_s * 1e9) + 1 if wanted.until_s is not None else 2**63 - 1
    windows = [(max(begin, first), min(end, last)) for first, last in windows_ns(sight)]
    return [(first, last) for first, last in windows if first < last]


def _folder() -> Path:
    folder: Path = settings.FLEET_VAR / "downloads"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder
