"""Recordings of a robot's topics: requests of the web process, and what pages learn of them."""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

from msgspec import Meta, Struct

from robots.shared.wire.base import Refusal, Seq, ShortText, TopicName

# black_box: the console kept what was before an event. by_hand: a person asked. booking: the booking, or its course.
RecordingKind = Literal["black_box", "by_hand", "booking"]
# Of a black box. gate: it held the robot back for over a second. fault: of a sensor, a part or the connection.
# contact: the robot reports that it touched something. keep: a person pressed "Keep this".
RecordingEvent = Literal["stop", "gate", "fault", "contact", "keep"]
MOST_RECORDED_TOPICS = 300
# Recorded topics: everything, everything but pictures, or these topics
RecordedTopics = (
    Literal["all", "pictures_not"]
    | Annotated[list[TopicName], Meta(min_length=1, max_length=MOST_RECORDED_TOPICS)]
)
LONGEST_RECORDING_S = 24 * 3600.0


class LinkRecord(Struct, frozen=True, tag_field="t", tag="link_record"):
    """Begin a recording. The web process has checked the right and recorded the request. The answer repeats `seq`.

    It belongs to nobody's control: it ends after `seconds`, by the bridge's own clock, at the end of the slot. One
    recording of a robot goes on at a time.
    """

    recording: UUID
    seconds: Annotated[float, Meta(gt=0.0, le=LONGEST_RECORDING_S)]
    topics: RecordedTopics
    by: ShortText  # name, for pages
    person: ShortText  # id
    kind: Literal["by_hand", "booking"] = "by_hand"
    reason: ShortText = ""
    session: ShortText = ""  # the control session that goes on
    booking: ShortText = ""
    course: ShortText = ""
    seq: Seq = 0


class LinkRecordEnd(Struct, frozen=True, tag_field="t", tag="link_record_end"):
    """End this recording; it is finished and kept. The answer repeats `seq`."""

    recording: UUID
    seq: Seq = 0


class LinkKeep(Struct, frozen=True, tag_field="t", tag="link_keep"):
    """Keep the last 30 s and the next 15 s as a black box. The answer repeats `seq`."""

    by: ShortText
    person: ShortText
    reason: ShortText = ""
    seq: Seq = 0


class RecordingState(Struct, frozen=True, omit_defaults=True):
    """The recording that goes on, or the last one if it ended by a fault (`refusal`)."""

    recording: UUID
    kind: RecordingKind
    by: str
    topics: Literal["all", "pictures_not"] | list[str]  # of chosen ones the first ten
    since_s: float
    left_s: float  # until it ends by itself
    topics_more: int = 0  # further chosen topics
    bytes: int = 0
    bytes_per_s: float = 0.0
    free_bytes: int | None = None  # that recordings may still take; None: not known yet
    dropped: int = 0  # messages that are missing in it, because disk or processor were too slow
    left_out: int = 0  # topics that are not recorded: there are more than `MOST_RECORDED_TOPICS`
    refusal: Refusal | None = None  # why nothing is written now; None: it is


class BlackBoxState(Struct, frozen=True, omit_defaults=True):
    """The black box: it runs while somebody has control."""

    seconds: int = 0  # that it holds now
    keeps: RecordingEvent | None = None  # the event that is being kept
    kept: int = 0  # events kept in this control
    dropped: int = 0  # messages that are missing in what it kept
    refusal: Refusal | None = None  # why nothing could be kept at the last event, or it does not run
