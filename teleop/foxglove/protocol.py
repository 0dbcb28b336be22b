"""Messages of `foxglove.websocket.v1`, as its specification has them (foxglove/ws-protocol, docs/spec.md).

`foxglove.sdk.v1` is the same protocol under another name. Only what a door that reads needs is here.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from robots.shared.messages.serialization import CDR
from robots.shared.messages.type_names import bare, is_ros2
from robots.shared.wire import MessageDecoder

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
LARGEST_BYTES = 64 * 1024  # of a client's message: the server lets no larger one through

Number = Annotated[int, Meta(ge=0, lt=2**32)]
Name = Annotated[str, Meta(max_length=200)]
Id = Annotated[str, Meta(max_length=200)] | None

INFO, WARNING, ERROR = 0, 1, 2  # levels of a status


# --- from clients -------------------------------------------------------------------------------------


class Subscription(Struct, frozen=True):
    """A channel that the client reads, under a number that it chose."""

    id: Number
    channelId: Number


class Subscribe(Struct, frozen=True, tag_field="op", tag="subscribe"):
    """Begin to send the messages of these channels."""

    subscriptions: list[Subscription]


class Unsubscribe(Struct, frozen=True, tag_field="op", tag="unsubscribe"):
    """End these subscriptions."""

    subscriptionIds: list[Number]


class GetParameters(Struct, frozen=True, tag_field="op", tag="getParameters"):
    """Send the values of these parameters; without names, of all."""

    parameterNames: list[Name] = []
    id: Id = None


class _Named(Struct, frozen=True):
    name: Name


class SetParameters(Struct, frozen=True, tag_field="op", tag="setParameters"):
    """Set parameters. Refused: the door only reads."""

    parameters: list[_Named] = []
    id: Id = None


class SubscribeConnectionGraph(Struct, frozen=True, tag_field="op", tag="subscribeConnectionGraph"):
    """Begin to send who publishes and subscribes what."""


class UnsubscribeConnectionGraph(Struct, frozen=True, tag_field="op", tag="unsubscribeConnectionGraph"):
    """Send it no more."""


class Advertise(Struct, frozen=True, tag_field="op", tag="advertise"):
    """Announce messages of the client. Refused: the door only reads."""


class Unadvertise(Struct, frozen=True, tag_field="op", tag="unadvertise"):
    """Announce them no more."""


class FetchAsset(Struct, frozen=True, tag_field="op", tag="fetchAsset"):
    """Send a file, such as a mesh. Refused: the door has no files."""

    requestId: Number


Request = (
    Subscribe
    | Unsubscribe
    | GetParameters
    | SetParameters
    | SubscribeConnectionGraph
    | UnsubscribeConnectionGraph
    | Advertise
    | Unadvertise
    | FetchAsset
)


request_of: MessageDecoder[Request] = MessageDecoder(Request, LARGEST_BYTES)


class ServiceCall(Struct, frozen=True):
    """A binary message that calls a service. Refused: the door only reads."""

    service: int
    call: int


def service_call(raw: bytes) -> ServiceCall | None:
    """Return the call of a binary message; None: it is no call."""
    return ServiceCall(*_CALL.unpack_from(raw, 1)) if raw[:1] == b"\2" and len(raw) > _CALL.size else None


# --- to clients ---------------------------------------------------------------------------------------


class Channel(Struct, frozen=True, kw_only=True):
    """A topic of the robot, with the definition of its messages."""

    id: int
    topic: str
    encoding: str
    schemaName: str
    schema: str
    schemaEncoding: str


def channel(number: int, topic: str, type_name: str, text: str) -> Channel:
    """Return the channel of a topic whose type has this definition."""
    encoding, schema_encoding = ("cdr", "ros2msg") if is_ros2(type_name) else ("ros1", "ros1msg")
    return Channel(
        id=number,
        topic=topic,
        encoding=encoding,
        schemaName=type_name,
        schema=text,
        schemaEncoding=schema_encoding,
    )


_CALL = struct.Struct("<II")
_MESSAGE = struct.Struct("<BIQ")
_TIME = struct.Struct("<BQ")
_NO_ASSET = struct.Struct("<BIBI")
_encoder = msgspec.json.Encoder()


def encoded(op: str, **fields: Any) -> str:
    """Return a message of this kind as JSON."""
    return _encoder.encode({"op": op, **fields}).decode()


def message_data(subscription: int, stamp_ns: int, body: bytes) -> bytes:
    """Return a message of a channel. The number of the subscription stands for the topic."""
    return _MESSAGE.pack(1, subscription, stamp_ns) + body


def time(stamp_ns: int) -> bytes:
    """Return the time by the robot's clock."""
    return _TIME.pack(2, stamp_ns)


def no_asset(request: int, why: str) -> bytes:
    """Return the answer to a request for a file that is not sent."""
    words = why.encode()
    return _NO_ASSET.pack(4, request, 1, len(words)) + words


def is_clock(type_name: str) -> bool:
    """Return whether messages of this type are times of a simulation."""
    return bare(type_name) == "rosgraph_msgs/Clock"


def clock_ns(body: bytes, type_name: str) -> int | None:
    """Return the time in a message of a clock; None: it is too short."""
    begin = len(CDR.head) if is_ros2(type_name) else 0
    if len(body) < begin + _CALL.size:
        return None
    secs, nsecs = _CALL.unpack_from(body, begin)
    return int(secs) * 1_000_000_000 + int(nsecs)
