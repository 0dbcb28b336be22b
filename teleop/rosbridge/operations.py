"""The operations that clients send, as rosbridge protocol v2 has them, with the fields that the console reads.

Names and types may be written as clients write them: without the first slash, types as in ROS 2 (`pkg/msg/Type`).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from robots.shared.sentences import reason_of, say
from robots.shared.wire import DEEPEST, MessageDecoder, Refusal, WireError, require_shallow

LARGEST_BYTES = 64 * 1024  # of one operation, in one frame or in fragments

Id = Annotated[str, Meta(max_length=200)] | int | None
Name = Annotated[str, Meta(max_length=200, pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*\Z")]
Type = Annotated[
    str, Meta(max_length=120, pattern=r"^[A-Za-z][A-Za-z0-9_]*(/msg|/srv|/action)?/[A-Za-z][A-Za-z0-9_]*\Z")
]
Compression = Literal["none", "png", "cbor", "cbor-raw"]
Level = Literal["info", "warning", "error", "none"]
# The console grants the nearest that it can
Number = Annotated[int, Meta(ge=-(2**53), le=2**53)] | float | None
Piece = Annotated[int, Meta(ge=0, le=100_000)]


def full_name(name: str) -> str:
    """Return the name as the robot knows it."""
    return name if name.startswith("/") else f"/{name}"


def full_type(type_: str) -> str:
    """Return the type as ROS 1 writes it."""
    package, *_, name = type_.split("/")
    return f"{package}/{name}"


class Advertise(Struct, frozen=True, tag_field="op", tag="advertise"):
    """The client will publish on a topic."""

    topic: Name
    type: Type
    id: Id = None


class Unadvertise(Struct, frozen=True, tag_field="op", tag="unadvertise"):
    topic: Name
    id: Id = None


class Publish(Struct, frozen=True, tag_field="op", tag="publish"):
    """`msg` may lack fields: they are zero, empty, or the present time."""

    topic: Name
    msg: dict[str, Any] = {}
    id: Id = None


class Subscribe(Struct, frozen=True, tag_field="op", tag="subscribe"):
    topic: Name
    type: Type | None = None
    throttle_rate: Number = None  # shortest time between two messages, ms
    queue_length: Number = None
    fragment_size: Number = None  # characters
    compression: Compression | None = None
    id: Id = None


class Unsubscribe(Struct, frozen=True, tag_field="op", tag="unsubscribe"):
    """Without `id`: all subscriptions of the topic."""

    topic: Name
    id: Id = None


class CallService(Struct, frozen=True, tag_field="op", tag="call_service"):
    service: Name
    args: dict[str, Any] | list[Any] | None = None
    timeout: Number = None  # seconds
    fragment_size: Number = None
    compression: Compression | None = None
    id: Id = None


class AdvertiseService(Struct, frozen=True, tag_field="op", tag="advertise_service"):
    service: Name
    type: Type
    id: Id = None


class UnadvertiseService(Struct, frozen=True, tag_field="op", tag="unadvertise_service"):
    service: Name
    id: Id = None


class ServiceResponse(Struct, frozen=True, tag_field="op", tag="service_response"):
    """The client's answer to a call of its own service."""

    service: Name
    result: bool = True
    values: Any = None
    id: Id = None


class AdvertiseAction(Struct, frozen=True, tag_field="op", tag="advertise_action"):
    action: Name
    type: Type
    id: Id = None


class UnadvertiseAction(Struct, frozen=True, tag_field="op", tag="unadvertise_action"):
    action: Name
    id: Id = None


class SendActionGoal(Struct, frozen=True, tag_field="op", tag="send_action_goal"):
    action: Name
    action_type: Type | None = None
    args: dict[str, Any] | list[Any] | None = None
    feedback: bool = False
    fragment_size: Number = None
    compression: Compression | None = None
    id: Id = None


class CancelActionGoal(Struct, frozen=True, tag_field="op", tag="cancel_action_goal"):
    action: Name
    id: Id = None


class ActionFeedback(Struct, frozen=True, tag_field="op", tag="action_feedback"):
    action: Name
    values: Any = None
    id: Id = None


class ActionResult(Struct, frozen=True, tag_field="op", tag="action_result"):
    action: Name
    result: bool = True
    status: int | None = None
    values: Any = None
    id: Id = None


class Fragment(Struct, frozen=True, tag_field="op", tag="fragment"):
    """A part of the text of another operation."""

    id: Annotated[str, Meta(max_length=200)] | int
    data: str
    num: Piece
    total: Piece


class SetLevel(Struct, frozen=True, tag_field="op", tag="set_level"):
    """The client wants status messages of this level and graver ones."""

    level: Level
    id: Id = None


class Auth(Struct, frozen=True, tag_field="op", tag="auth"):
    """Sign in: `mac` is the text of a token. Nothing else that rosbridge's own `auth` has is read."""

    mac: Annotated[str, Meta(max_length=500)]
    id: Id = None


Operation = (
    Advertise
    | Unadvertise
    | Publish
    | Subscribe
    | Unsubscribe
    | CallService
    | AdvertiseService
    | UnadvertiseService
    | ServiceResponse
    | AdvertiseAction
    | UnadvertiseAction
    | SendActionGoal
    | CancelActionGoal
    | ActionFeedback
    | ActionResult
    | Fragment
    | SetLevel
    | Auth
)
_operation_of = MessageDecoder[Operation](Operation, LARGEST_BYTES)


def operation_of(raw: str) -> Operation:
    """Return the operation. Raises WireError: also if its values are nested too deeply to be passed on."""
    operation = _operation_of(raw)
    if raw.count("[") + raw.count("{") > DEEPEST:
        try:
            for field in ("msg", "args", "values"):
                require_shallow(getattr(operation, field, None))
        except ValueError as error:
            text = say("The message does not fit: {error}", error=reason_of(error))
            raise WireError(Refusal("invalid", text, "wire")) from error
    return operation


class _Vector(Struct, frozen=True, forbid_unknown_fields=True):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class _Twist(Struct, frozen=True, forbid_unknown_fields=True):
    linear: _Vector = _Vector()
    angular: _Vector = _Vector()


class PublishTwist(Struct, frozen=True, tag_field="op", tag="publish"):
    """A `Publish` of a geometry_msgs/Twist: the most frequent operation, decoded quickly."""

    topic: Name
    msg: _Twist = _Twist()


twist_of = MessageDecoder[PublishTwist](PublishTwist, LARGEST_BYTES)
