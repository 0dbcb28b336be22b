"""Messages between the bridge and its recorder: one JSON line each. And what the bridge says about the chain."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from uuid import UUID

import msgspec
from msgspec import Struct

from robots.bridge.recorder.black_box.ring import Origin
from robots.shared import wire
from robots.shared.records.record_sink import TakenRecording
from robots.shared.sentences import say
from robots.shared.wire import BlackBoxState, RecordingEvent, RecordingState, Refusal

VIEW, COMMAND, VERDICT, EVENT = "/fleet/view", "/fleet/command", "/fleet/verdict", "/fleet/event"


class Command(Struct, frozen=True, omit_defaults=True):
    """A stick position as it came, and why it was refused."""

    drive: wire.Drive
    refusal: Refusal | None = None


class ChainEvent(Struct, frozen=True, omit_defaults=True):
    """An event in the chain: one of `RecordingEvent`; control_begins, control_ends; or refused."""

    event: str
    text: str = ""
    by: str = ""
    code: str = ""  # of the rule
    figures: Mapping[str, float | int | str | None] = {}  # of a refusal


# Channels that the bridge writes, with the type of their messages
CHANNELS: dict[str, type[Struct]] = {
    VIEW: wire.View,
    COMMAND: Command,
    VERDICT: wire.Verdict,
    EVENT: ChainEvent,
}


@cache
def origin_of(topic: str) -> Origin:
    """Return the origin of messages on one of `CHANNELS`."""
    kind = CHANNELS[topic]
    schema = msgspec.json.encode(msgspec.json.schema(kind)).decode()
    return Origin(topic, "json", f"fleet/{kind.__name__}", "", schema)


# --- to the recorder ---------------------------------------------------------------------------------


class Said(Struct, frozen=True, tag_field="t", tag="said"):
    """A message on one of `CHANNELS`, with names, which no file has. `at_ns`: by the monotonic clock."""

    topic: str
    at_ns: int
    message: msgspec.Raw


class InControl(Struct, frozen=True, tag_field="t", tag="control"):
    """The person in control: the black box runs. `person` empty: nobody, and it ends soon."""

    person: str = ""
    session: str = ""


class Happened(Struct, frozen=True, tag_field="t", tag="happened"):
    """An event that the black box keeps. `person`: who asked for it, if it is not who has control. Answer: `Kept`."""

    event: RecordingEvent
    at_ns: int
    text: str
    by: str = ""
    person: str = ""


class Begin(Struct, frozen=True, tag_field="t", tag="begin"):
    """Begin a recording. Answer: `Begun`."""

    order: wire.LinkRecord
    continues: UUID | None = None


class End(Struct, frozen=True, tag_field="t", tag="end"):
    """End this recording. `why`: in English, if nobody asked for it."""

    recording: UUID
    why: str = ""


class Lost(Struct, frozen=True, tag_field="t", tag="lost"):
    """Messages on one of `CHANNELS` that were not sent: they would have waited too long."""

    topic: str
    count: int


class Stored(Struct, frozen=True, tag_field="t", tag="stored"):
    """The recording has its row: do not report it again."""

    recording: UUID


RecorderRequest = Said | Lost | InControl | Happened | Begin | End | Stored

# --- from the recorder -------------------------------------------------------------------------------


class Progress(Struct, frozen=True, tag_field="t", tag="progress"):
    """The present work: a sign of life, each second."""

    recording: RecordingState | None
    black_box: BlackBoxState | None


class Begun(Struct, frozen=True, tag_field="t", tag="begun"):
    """A recording began, or was refused."""

    recording: UUID
    refusal: Refusal | None = None


class Kept(Struct, frozen=True, tag_field="t", tag="kept"):
    """The event of this time is being kept, or why it cannot be."""

    at_ns: int
    refusal: Refusal | None = None


class Continued(Struct, frozen=True, tag_field="t", tag="continued"):
    """A recording goes on in a new file: this one is full."""

    recording: UUID
    by: UUID


class Over(Struct, frozen=True, tag_field="t", tag="over"):
    """A recording that had begun goes on no longer, whether or not its file could be finished."""

    recording: UUID


class Finished(Struct, frozen=True, tag_field="t", tag="finished"):
    """A recording that has no row yet. Repeated until `Stored`."""

    taken: TakenRecording


class Removed(Struct, frozen=True, tag_field="t", tag="removed"):
    """A black box that was removed for newer recordings."""

    recording: UUID


RecorderReport = Progress | Begun | Kept | Continued | Over | Finished | Removed


def goes_on(by: str, recording: UUID) -> Refusal:
    """Return the refusal of a second recording."""
    text = say("{by} already records this robot: there is one recording at a time.", by=by)
    return Refusal("recording_goes_on", text, "robot", {"recording": str(recording)})
