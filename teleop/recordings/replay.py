"""Data of the replay page: an index, views of a time, pictures, series of numbers.

Times are seconds since the recording began. Nothing outside the parts that a person may see is returned.
"""

from __future__ import annotations

from datetime import timedelta
from itertools import islice
from typing import Any

from msgspec import Struct, structs

from robots.recordings.files.contents import Contents, Recorded, is_picture
from robots.recordings.files.decoding import Decoder, UnknownType, number_at
from robots.shared.wire import NotDone, Refusal
from teleop.recordings import times
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
_NO_PICTURE = Refusal("no_picture", "The recording has no picture of this topic at this moment.", "wire")
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
    channels: dict[tuple[str, str], RecordedChannel] = {}
    for channel in contents.channels:
        schema = contents.schema_of(channel)
        key = channel.topic, schema.name if schema else ""
        count = contents.count(channel)
        if (same := channels.get(key)) is not None:  # of another publisher
            channels[key] = structs.replace(same, messages=same.messages + count)
            continue
        try:
            fields = OWN_FIELDS.get(channel.topic) or Decoder(channel, schema).number_fields()
        except UnknownType:
            fields = []
        channels[key] = RecordedChannel(*key, count, is_picture(key[1]), fields)
    recording = sight.recording
    return RecordedContents(
        times.since(recording, recording.ends_at),
        [(times.since(recording, begin), times.since(recording, end)) for begin, end in sight.parts],
        list(channels.values()),
        any(topic == VIEW for topic, _ in channels),
    )


def views(sight: Sight, contents: Contents, from_s: float, until_s: float) -> bytes:
    """Return the views of a time as JSON: {"views": [[at_s, view, command or null], …], "until_s": …}.

    It ends earlier than asked after `LONGEST_S` or `MOST_BYTES`, and with the part. Raises `NotDone`.
    """
    part = _part(sight, from_s)
    until_s = min(until_s, from_s + LONGEST_S, times.since(sight.recording, part.ends_at))
    pieces: list[bytes] = []
    size = 0
    begin_ns, end_ns = _window(sight, part, from_s, until_s)
    command, commanded_ns = b"null", 0
    before_ns = max(begin_ns - COMMAND_LASTS_NS, times.ns_of(part.begins_at))
    for recorded in contents.messages([VIEW, COMMAND], before_ns, end_ns):
        if recorded.channel.topic == COMMAND:
            command, commanded_ns = recorded.message.data, recorded.message.log_time
            continue
        if recorded.message.log_time < begin_ns:
            continue
        if recorded.message.log_time > commanded_ns + COMMAND_LASTS_NS:
            command = b"null"
        at_s = round(times.at_s(sight.recording, recorded.message.log_time), 3)
        size += len(recorded.message.data)
        if size > MOST_BYTES and pieces:
            until_s = at_s
            break
        pieces.append(b"[%s,%s,%s]" % (repr(at_s).encode(), recorded.message.data, command))
    return b'{"views":[%s],"until_s":%s}' % (b",".join(pieces), repr(round(until_s, 3)).encode())


def picture(sight: Sight, contents: Contents, topic: str, at_s: float) -> tuple[float, Any]:
    """Return time and message of the last picture until a moment, as the robot sent it. Raises `NotDone`."""
    part = _part(sight, at_s)
    until_ns = min(times.ns_at(sight.recording, at_s), times.ns_of(part.ends_at))
    found = contents.newest(topic, until_ns)
    kind = found.schema.name if found is not None and found.schema is not None else ""
    if found is None or not is_picture(kind) or found.message.log_time < times.ns_of(part.begins_at):
        raise NotDone(_NO_PICTURE)
    at = times.at_s(sight.recording, found.message.log_time)
    try:
        return at, Decoder(found.channel, found.schema).read(found.message.data)
    except UnknownType as error:
        raise NotDone(_UNKNOWN) from error


def series(
    sight: Sight, contents: Contents, topic: str, field: str, from_s: float, until_s: float
) -> RecordedSeries:
    """Return at most `MOST_POINTS` numbers of a field, evenly chosen. Raises `NotDone`."""
    part = _part(sight, from_s)
    window = _window(sight, part, from_s, until_s)
    count = sum(1 for _ in islice(contents.messages([topic], *window), MOST_READ))
    step = max(1, -(-count // MOST_POINTS))
    points = RecordedSeries([], [])
    numbers = _Numbers(field)
    for recorded in islice(contents.messages([topic], *window), 0, MOST_READ, step):
        points.at_s.append(round(times.at_s(sight.recording, recorded.message.log_time), 4))
        points.values.append(numbers.of(recorded))
    if points.at_s and not numbers.readable:
        raise NotDone(_UNKNOWN)
    return points


class _Numbers:
    """Reads a field of a topic. Each publisher, and each type that the topic had, has a channel with its decoder."""

    def __init__(self, field: str) -> None:
        self._field = field
        self._decoders: dict[int, Decoder | None] = {}  # by channel; None: its messages cannot be read
        self.readable = False  # one of them at least

    def of(self, recorded: Recorded) -> float | None:
        """Return the number in a message; None: there is none, or it cannot be read."""
        channel = recorded.channel
        try:
            if channel.id not in self._decoders:
                self._decoders[channel.id] = None
                self._decoders[channel.id] = Decoder(channel, recorded.schema)
            decoder = self._decoders[channel.id]
            message = decoder.read(recorded.message.data) if decoder is not None else None
        except UnknownType:
            return None
        self.readable = self.readable or message is not None
        return number_at(message, self._field)


def _part(sight: Sight, at_s: float) -> Part:
    """Return the part with this moment; its ends are told in milliseconds. Raises `NotDone`."""
    moment = sight.recording.begins_at + timedelta(seconds=at_s)
    for near in (moment, moment + MILLISECOND, moment - MILLISECOND):
        if (part := sight.part_at(near)) is not None:
            return part
    raise NotDone(_NOT_YOURS)


def _window(sight: Sight, part: Part, from_s: float, until_s: float) -> tuple[int, int]:
    """Return a time within a part in ns; the end is exclusive."""
    [window] = times.windows_ns(sight.recording, [part], from_s, until_s) or [(0, 0)]
    return window
