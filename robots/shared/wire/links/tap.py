"""Whole messages of topics, for programs: messages of the link to a tap.

A message is one binary frame as in `camera`: header and body. The tap encodes the body once for all readers.
"""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import msgspec
from msgspec import Meta, Struct

from robots.shared.wire.base import Refusal, TopicName
from robots.shared.wire.codec import framed, unframed

Form = Literal["json", "cbor", "raw"]  # the first two as rosbridge encodes `msg`; raw: the publisher’s bytes
FORMS: tuple[Form, ...] = get_args(Form)
MOST_TAPPED = 400  # topics of one robot through one web process
MOST_QUEUED = 100  # messages of a topic
LARGEST_BODY = 16 * 1024 * 1024  # bytes
LARGEST_TAPPED = LARGEST_BODY + 64 * 1024  # with its header
TAP_PING_S = 10.0  # on a slow network one message takes seconds, and an answer to a ping waits behind it


class TapWant(Struct, frozen=True):
    """At most one message each `every_s` (0: each message); at most `queue` wait for a reader that is behind."""

    every_s: Annotated[float, Meta(ge=0.0, le=3600.0)] = 0.0
    queue: Annotated[int, Meta(ge=1, le=MOST_QUEUED)] = 1


TopicWants = Annotated[dict[Form, TapWant], Meta(min_length=1)]


class TapWants(Struct, frozen=True, tag_field="t", tag="tap_wants"):
    """All topics that a web process reads, with the forms of each."""

    topics: Annotated[dict[TopicName, TopicWants], Meta(max_length=MOST_TAPPED)]


class TapHeader(Struct, frozen=True):
    """Header of one message. `number` counts those of the topic, also those that are not sent."""

    topic: str
    form: Form
    number: int
    stamp_ns: int  # of the arrival, by the clock of the bridge's computer
    publisher: int  # differs between the publishers of the topic
    latched: bool = False  # the publisher's newest message is also for those who come later


class TapState(Struct, frozen=True, tag_field="t", tag="tap_state"):
    """A topic as its publishers describe it. `type` is empty until one has answered.

    `refusal`: why no message comes, or why some are left out; with `form`: in this form only.
    """

    topic: str
    type: str = ""
    md5: str = ""
    definition: str = ""  # with those of the types that it uses; empty if it is not known
    latched: bool = False
    refusal: Refusal | None = None
    form: Form | None = None


_header = msgspec.json.Decoder(TapHeader)


def tapped(header: TapHeader, body: bytes) -> bytes:
    """Return one frame with header and body."""
    return framed(header, body)


def untapped(frame: bytes) -> tuple[TapHeader, memoryview]:
    """Return header and body of a frame. Raises msgspec.DecodeError."""
    header, body = unframed(frame)
    return _header.decode(header), body
