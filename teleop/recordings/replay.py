"""Data of the replay page: an index, views of a time, pictures, series of numbers.

Times are seconds since the recording began. Nothing outside the parts that a person may see is returned.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Any

from msgspec import Struct

from robots.recordings.files.contents import PICTURES, Contents
from robots.recordings.files.decoding import Decoder, UnknownType, number_at
from robots.shared.wire import NotDone, Refusal
from teleop.recordings.selectors import Part, Sight

VIEW, COMMAND = "/fleet/view", "/fleet/command"
# Numbers of the console's own channels, which are JSON, that can be plotted
OWN_FIELDS = {
    VIEW: [
        "state.odometry.vx",
        "state.odometry.vy",
        "state.odometry.w",
        "state.battery_percent",
        "state.latency_s",
    ],
    COMMAND: ["drive.x", "drive.y", "drive.w", "drive.share"],
    "/fleet/verdict": [
        *(f"{name}[{axis}]" for name in ("asked", "allowed") for axis in range(3)),
        "distance_m",
        "bearing_rad",
    ],
}
COMMAND_LASTS_NS = 500_000_000  # a stick position is shown with the views of this time after it
LONGEST_S = 30.0  # of views in one answer
MOST_BYTES = 4 * 1024 * 1024  # of views in one answer
MOST_POINTS = 2000  # of a series
MILLISECOND = timedelta(milliseconds=1)
MOST_READ = 400_000  # messages that are counted for a series

_NOT_YOURS = Refusal(
    "not_your_part", "This moment of the recording shows somebody else’s session.", "account"
)
_NO_TOPIC = Refusal("no_topic", "The recording has no such topic.", "wire")
_UNKNOWN = Refusal("type_unknown", "The messages of this topic cannot be read.", "robot")


class RecordedChannel(Struct, frozen=True):
    """A topic of a recording."""

    topic: str
    type: str
    messages: int
    picture: bool
    fields: list[str]  # numbers that can be plotted


class RecordedContents(Struct, frozen=True):
    """The first data of the page."""

    lasts_s: float
    parts: list[tuple[float, float]]  # that the person sees
    channels: list[RecordedChannel]
    has_views: bool


class RecordedSeries(Struct, frozen=True):
    """Numbers of a field over time."""

    at_s: list[float]
    values: list[float | None]


def contents_of(sight: Sight, contents: Contents) -> RecordedContents:
    """Return what is in the recording."""
    channels = []
    for channel in contents.channels:
        schema = contents.schema_of(channel)
        try:
            fields = OWN_FIELDS.get(channel.topic) or Decoder(channel, schema).number_fields()
        except UnknownType:
            fields = []
        kind = schema.name if schema else ""
        channels.append(
            RecordedChannel(channel.topic, kind, contents.count(channel), kind in PICTURES, fields)
        )
    recording = sight.recording
    return RecordedContents(
        (recording.ends_at - recording.begins_at).total_seconds(),
        [(_since(sight, part.begins_at), _since(sight, part.ends_at)) for part in sight.parts],
        channels,
        any(channel.topic == VIEW for channel in channels),
    )


def views(sight: Sight, contents: Contents, from_s: float, until_s: float) -> bytes:
    """Return the views of a time as JSON: {"views": [[at_s, view, command or null], …], "until_s": …}.

    It ends earlier than asked after `LONGEST_S` or `MOST_BYTES`, and with the part. Raises `NotDone`.
    """
    part = _part(sight, from_s)
    until_s = min(until_s, from_s + LONGEST_S, _since(sight, part.ends_at))
    pieces: list[bytes] = []
    size = 0
    begin_ns, end_ns = _window(sight, part, from_s, until_s)
    command, commanded_ns = b"null", 0
    before_ns = max(begin_ns - COMMAND_LASTS_NS, _ns_of(part.begins_at))
    for recorded in contents.messages([VIEW, COMMAND], before_ns, end_ns):
        if recorded.channel.topic == COMMAND:
            command, commanded_ns = recorded.message.data, recorded.message.log_time
            continue
        if recorded.message.log_time < begin_ns:
            continue
        if recorded.message.log_time > commanded_ns + COMMAND_LASTS_NS:
            command = b"null"
        at_s = round(_at_s(sight, recorded.message.log_time), 3)
        size += len(recorded.message.data)
        if size > MOST_BYTES and pieces:
            until_s = at_s
            break
        pieces.append(b"[%s,%s,%s]" % (repr(at_s).encode(), recorded.message.data, command))
    return b'{"views":[%s],"until_s":%s}' % (b",".join(pieces), repr(round(until_s, 3)).encode())


def picture(sight: Sight, contents: Contents, topic: str, at_s: float) -> tuple[float, Any]:
    """Return time and message of the last picture until a moment, as the robot sent it. Raises `NotDone`."""
    part = _part(sight, at_s)
    found = contents.newest(topic, min(_ns(sight, at_s), _ns_of(part.ends_at)))
    if found is None or found.message.log_time < _ns_of(part.begins_at):
        raise NotDone(_NO_TOPIC)
    try:
        return _at_s(sight, found.message.log_time), Decoder(found.channel, found.schema).read(
            found.message.data
        )
    except UnknownType as error:
        raise NotDone(_UNKNOWN) from error


def series(
    sight: Sight, contents: Contents, topic: str, field: str, from_s: float, until_s: float
) -> RecordedSeries:
    """Return at most `MOST_POINTS` numbers of a field, evenly chosen. Raises `NotDone`."""
    part = _part(sight, from_s)
    until_s = min(until_s, _since(sight, part.ends_at))
    window = _window(sight, part, from_s, until_s)
    count = sum(1 for _ in islice(contents.messages([topic], *window), MOST_READ))
    step = max(1, -(-count // MOST_POINTS))
    points = RecordedSeries([], [])
    decoder: Decoder | None = None
    for recorded in islice(contents.messages([topic], *window), 0, MOST_READ, step):
        try:
            decoder = decoder or Decoder(recorded.channel, recorded.schema)
            message = decoder.read(recorded.message.data)
        except UnknownType as error:
            raise NotDone(_UNKNOWN) from error
        points.at_s.append(round(_at_s(sight, recorded.message.log_time), 4))
        points.values.append(number_at(message, field))
    return points


def windows_ns(sight: Sight) -> Iterator[tuple[int, int]]:
    """Yield the parts that a person sees, in ns; the end is exclusive."""
    for part in sight.parts:
        yield _ns_of(part.begins_at), _ns_of(part.ends_at) + 1


def _part(sight: Sight, at_s: float) -> Part:
    """Return the part with this moment; its ends are told in milliseconds. Raises `NotDone`."""
    moment = sight.recording.begins_at + timedelta(seconds=at_s)
    for near in (moment, moment + MILLISECOND, moment - MILLISECOND):
        if (part := sight.part_at(near)) is not None:
            return part
    raise NotDone(_NOT_YOURS)


def _window(sight: Sight, part: Part, from_s: float, until_s: float) -> tuple[int, int]:
    """Return a time within a part in ns; the end is exclusive."""
    begin_ns = max(_ns(sight, from_s), _ns_of(part.begins_at))
    return begin_ns, min(_ns(sight, until_s), _ns_of(part.ends_at)) + 1


def _since(sight: Sight, moment: datetime) -> float:
    return round((moment - sight.recording.begins_at).total_seconds(), 3)


def _ns(sight: Sight, at_s: float) -> int:
    return _ns_of(sight.recording.begins_at) + round(at_s * 1e9)


def _ns_of(moment: datetime) -> int:
    whole = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (whole.days * 86_400 + whole.seconds) * 1_000_000_000 + whole.microseconds * 1000


def _at_s(sight: Sight, log_ns: int) -> float:
    return (log_ns - _ns_of(sight.recording.begins_at)) / 1e9
