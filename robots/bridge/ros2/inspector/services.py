"""Calls of services by rclpy, which knows the classes of requests and answers."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.bridge.ros2.message_types import TypeUnknown, message_class
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.side import Service
from robots.shared.messages.definition import Definition
from robots.shared.sentences import reason_of, say
from robots.shared.texts import NAME, cut

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
    node: Node, service: Service, request: bytes, require_time: Callable[[], None], largest: int
) -> bytes:
    """Call a service; return its serialized answer. Raises Declined.

    `require_time` is called just before the request is sent, and raises if it is too late.
    """
    try:
        kind = message_class(service.type)
    except TypeUnknown as error:
        raise declined.unknown_type(service.type, reason_of(error)) from error
    client, answered = node.create_client(kind, service.name), threading.Event()
    try:
        if not client.wait_for_service(CALL_S):
            raise declined.lost(service.name, say("no node serves it any more"))
        require_time()
        answer = client.call_async(deserialize_message(request, kind.Request))
        answer.add_done_callback(lambda _: answered.set())
        if not answered.wait(CALL_S):
            raise declined.silent(service.name, CALL_S)
        data: bytes = serialize_message(answer.result())
    finally:
        node.destroy_client(client)
    if len(data) > largest:
        raise declined.lost(service.name, say("its answer has {count} bytes", count=len(data)))
    return data
