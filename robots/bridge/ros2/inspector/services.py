"""Calls of services by rclpy, which knows the classes of requests and answers."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.serialization import deserialize_message, serialize_message

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.bridge.ros2.message_types import TypeUnknown, message_class
from robots.bridge.ros2.participant import Participant, Silent
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.side import Service
from robots.shared.messages.definition import Definition
from robots.shared.sentences import reason_of, say
from robots.shared.texts import NAME, cut
from robots.shared.unreachable import Unreachable

CALL_S = 1.5  # until a service must have answered


def described(type_name: str, response: bool = False) -> Definition:
    """Return the request or response of an installed service type. Raises Declined."""
    package, _, name = type_name.partition("/")
    part = "Response" if response else "Request"
    try:
        return definition(f"{package}/srv/{name.removeprefix('srv/')}_{part}")
    except UnknownTypeError as error:
        raise declined.unknown_type(cut(type_name, NAME), str(error)) from error


def exchange(
    participant: Participant,
    service: Service,
    request: bytes,
    require_time: Callable[[], None],
    largest: int,
) -> bytes:
    """Call a service; return its serialized answer. Raises Declined.

    `require_time` is called just before the request is sent, and raises if it is too late.
    """
    try:
        kind = message_class(service.type)
        asked = deserialize_message(request, kind.Request)
        answer = participant.ask(kind, service.name, asked, CALL_S, require_time)
    except TypeUnknown as error:
        raise declined.unknown_type(service.type, reason_of(error)) from error
    except Silent as error:
        raise declined.silent(service.name, CALL_S) from error
    except Unreachable as error:
        raise declined.lost(service.name, reason_of(error)) from error
    data: bytes = serialize_message(answer)
    if len(data) > largest:
        raise declined.lost(service.name, say("its answer has {count} bytes", count=len(data)))
    return data
