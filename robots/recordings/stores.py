"""The files of recordings where they are. Today: on the computer of the bridge, if the web process runs there, too."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Literal

from robots.recordings.away import FileAway
from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import picture_of
from robots.recordings.s3.object_file import open_object, read_object

Part = Literal["file", "thumbnail"]
_PICTURE = ".jpg"


def open_file(recording: Recording) -> BinaryIO:
    """Open the MCAP file for reading. It never changes. Raises `FileAway`, also from its methods."""
    return _opened(recording, "file")


def open_thumbnail(recording: Recording) -> BinaryIO:
    """Open the small picture (JPEG). Raises `FileAway`, also from its methods."""
    return _opened(recording, "thumbnail")


def _opened(recording: Recording, part: Part) -> BinaryIO:
    match recording.place:
        case Place.DIRECTORY:
            return _in_directory(recording, part)
        case Place.S3:
            key = recording.object
            return open_object(key) if part == "file" else BytesIO(read_object(picture_of(key)))
        case _:
            raise FileAway


def _in_directory(recording: Recording, part: Part) -> BinaryIO:
    name = recording.file
    if not name or Path(name).name != name or not recording.directory:
        raise FileAway
    path = Path(recording.directory) / name
    try:
        return (path.with_suffix(_PICTURE) if part == "thumbnail" else path).open("rb")
    except OSError as error:
        raise FileAway from error
