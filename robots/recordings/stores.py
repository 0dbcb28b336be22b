"""The files of recordings where they are: in the directory of a computer, this or another one, or in a store."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from robots.recordings.away import FileAway
from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import picture_of
from robots.recordings.s3.object_file import open_object, read_object
from robots.recordings.shelf_file import open_on_shelf
from robots.registry.selectors import link_address
from robots.shared.wire import RecordingPart

_PICTURE = ".jpg"


def open_file(recording: Recording) -> BinaryIO:
    """Open the MCAP file for reading. It never changes. Raises `FileAway`, also from its methods."""
    return _opened(recording, "file")


def open_thumbnail(recording: Recording) -> BinaryIO:
    """Open the small picture (JPEG). Raises `FileAway`, also from its methods."""
    return _opened(recording, "thumbnail")


def _opened(recording: Recording, part: RecordingPart) -> BinaryIO:
    match recording.place:
        case Place.DIRECTORY:
            return _in_directory(recording, part)
        case Place.S3:
            key = recording.object
            return open_object(key) if part == "file" else BytesIO(read_object(picture_of(key)))
        case _:
            raise FileAway


def _in_directory(recording: Recording, part: RecordingPart) -> BinaryIO:
    """Open a file in the directory here; if it is not here, through the shelf of the bridge's computer."""
    name = recording.file
    if not name or Path(name).name != name or not recording.directory:
        raise FileAway
    path = Path(recording.directory) / name
    try:
        return (path.with_suffix(_PICTURE) if part == "thumbnail" else path).open("rb")
    except OSError as error:
        address = link_address(recording.robot)
        if address.host is None:  # the bridge is on this computer
            raise FileAway from error
        return open_on_shelf(recording.robot_id, address, recording.pk, part)
