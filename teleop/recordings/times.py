"""Times of a recording: moments of the day, seconds since it began, and nanoseconds since 1970 as its file has them."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime

from robots.recordings.models import Recording
from teleop.recordings.selectors import Part


def since(recording: Recording, moment: datetime) -> float:
    """Return a moment in seconds since the recording began, to the millisecond."""
    return round((moment - recording.begins_at).total_seconds(), 3)


def since_s(recording: Recording, unix_s: float) -> float:
    """Return a Unix time in seconds since the recording began, to the millisecond."""
    return round(unix_s - recording.begins_at.timestamp(), 3)


def at_s(recording: Recording, log_ns: int) -> float:
    """Return a time of the file in seconds since the recording began."""
    return (log_ns - ns_of(recording.begins_at)) / 1e9


def ns_at(recording: Recording, seconds: float) -> int:
    """Return the time of the file so many seconds after the recording began."""
    return ns_of(recording.begins_at) + round(seconds * 1e9)


def ns_of(moment: datetime) -> int:
    """Return a moment as a time of the file."""
    whole = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (whole.days * 86_400 + whole.seconds) * 1_000_000_000 + whole.microseconds * 1000


def windows_ns(
    recording: Recording, parts: Iterable[Part], from_s: float | None = None, until_s: float | None = None
) -> list[tuple[int, int]]:
    """Return what lies in these parts of the time from `from_s` until `until_s`; the ends are exclusive."""
    begin = 0 if from_s is None else ns_at(recording, from_s)
    end = 2**63 - 1 if until_s is None else ns_at(recording, until_s) + 1
    windows = [(max(begin, ns_of(part.begins_at)), min(end, ns_of(part.ends_at) + 1)) for part in parts]
    return [(first, last) for first, last in windows if first < last]
