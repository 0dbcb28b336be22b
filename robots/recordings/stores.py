"""The files of recordings where they are. Today: on the computer of the bridge, if the web process runs there, too."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from robots.recordings.models import Place, Recording
from robots.shared.wire import Refusal

_AWAY = Refusal(
    "recording_away",
    "The file of this recording cannot be read now: its computer or disk is out of reach.",
    "robot",
)
_PICTURE = ".jpg"


class FileAway(Exception):
    """Raised if a file cannot be reached; `refusal` says so."""

    refusal = _AWAY


def open_file(recording: Recording) -> BinaryIO:
    """Open the MCAP file for reading. Raises `FileAway`."""
    return _opened(path_of(recording))


def open_thumbnail(recording: Recording) -> BinaryIO:
    """Open the small picture (JPEG). Raises `FileAway`."""
    return _opened(path_of(recording).with_suffix(_PICTURE))


def path_of(recording: Recording) -> Path:
    """Return the path of the file on this computer. Raises `FileAway`."""
    name = recording.file
    if recording.place != Place.DIRECTORY or not name or Path(name).name != name or not recording.directory:
        raise FileAway
    return Path(recording.directory) / name


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise FileAway from error
