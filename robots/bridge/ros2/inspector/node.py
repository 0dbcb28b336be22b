"""Subscriptions and publications of the inspector, of any type that is installed."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node as RosNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.bridge.ros2.message_types import TypeUnknown, message_class
from robots.bridge.ros2.network.graph import node_name
from robots.bridge.ros2.participant import NO_EVENTS, Participant, TypeInUse, guarded
from robots.bridge.ros2.qos import as_offered
from robots.bridge.ros2.versions import Versions
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.side import Received, Talker
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition
from robots.shared.sentences import reason_of, say
from robots.shared.wire import Refusal

QUEUE = 20  # messages that wait for the executor: they are counted
LEAVE_S = 0.5
LOOK_S = 0.01


def known(type_name: str) -> Definition:
    """Return the definition of an installed type. Raises Declined."""
    try:
        return definition(type_name)
    except UnknownTypeError as error:
        raise declined.unknown_type(type_name, str(error)) from error


def _other(type_name: str) -> Definition:
    """Refuse to read a message whose publisher has another version of its type."""
    text = say("{type} has other fields on the robot than in the package installed here.", type=type_name)
    raise declined.unknown_type(type_name, text)


class Node:
    """Subscribes and publishes in the robot's domain."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant

    def subscribe(self, topic: str, take: Callable[[Received], None]) -> Source:
        """Subscribe to a topic with the type of its publishers."""
        return Source(self._participant.node, topic, take)

    def advertise(self, topic: str, definition: Definition) -> Writer:
        """Publish messages of an installed type."""
        return Writer(self._participant.node, topic, definition)

    def leave(self) -> None:
        """Leave the domain."""
        self._participant.close(LEAVE_S)


class Source:
    """A subscribed topic. DDS connects equal types only, so the subscription follows the publishers' type."""

    def __init__(self, node: RosNode, topic: str, take: Callable[[Received], None]) -> None:
        self._node = node
        self._topic = topic
        self._take = take
        self._asked: tuple[str, QoSProfile] | None = None  # type and profile of the subscription
        self._subscription: Any = None
        self._refusal: Refusal | None = None
        self.talkers()

    def talkers(self) -> list[Talker]:
        """Return the publishers; subscribe with their type and as much as all of them offer."""
        found = self._node.get_publishers_info_by_topic(self._topic)
        publishers = [one for one in found if not node_name(one).startswith(INSPECTOR)]
        if publishers:
            self._follow(publishers)
        return [Talker(node_name(one), one.topic_type, str(one.topic_type_hash)) for one in publishers]

    def refusal(self) -> Refusal | None:
        """Return a refusal for a type whose package is not installed."""
        return self._refusal

    def close(self) -> None:
        """Unsubscribe."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _follow(self, publishers: list[TopicEndpointInfo]) -> None:
        type_name = publishers[0].topic_type
        qos = as_offered(one.qos_profile for one in publishers)
        qos.depth = QUEUE
        if (type_name, qos) == self._asked:
            return
        self.close()
        self._asked = type_name, qos
        self._refusal = None
        try:
            kind = message_class(type_name)
        except TypeUnknown as error:
            self._refusal = Refusal("type_unknown", reason_of(error), "robot", {"type": type_name})
            return
        versions = Versions(self._node, self._topic, type_name)
        receive = guarded(lambda data, info: self._receive(type_name, versions, data, info))
        try:
            self._subscription = self._node.create_subscription(
                kind, self._topic, receive, qos, event_callbacks=NO_EVENTS, raw=True
            )
        except TypeInUse:  # until the next look
            self._asked = None

    def _receive(self, type_name: str, versions: Versions, data: bytes, info: Any) -> None:
        fields = _other if versions.other(info) else known
        self._take(Received(type_name, data, partial(fields, type_name)))


class Writer:
    """A topic on which the inspector publishes. It offers what its listeners ask for."""

    def __init__(self, node: RosNode, topic: str, definition: Definition) -> None:
        self._node = node
        self._topic = topic
        listeners = node.get_subscriptions_info_by_topic(topic)
        stays = any(one.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in listeners)
        profile = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if stays else DurabilityPolicy.VOLATILE,
        )
        try:
            kind = message_class(definition.type)
        except TypeUnknown as error:
            raise declined.unknown_type(definition.type, reason_of(error)) from error
        self._publisher = node.create_publisher(
            kind, topic, profile, event_callbacks=PublisherEventCallbacks(use_default_callbacks=False)
        )

    def await_listeners(self, within_s: float) -> None:
        """Wait until those that the domain knows are connected."""
        deadline_s = time.monotonic() + within_s
        listeners = self._node.get_subscriptions_info_by_topic(self._topic)
        of_the_type = {one.topic_type for one in self._node.get_publishers_info_by_topic(self._topic)}
        known = sum(one.topic_type in of_the_type for one in listeners)
        while self._publisher.get_subscription_count() < known and time.monotonic() < deadline_s:
            time.sleep(LOOK_S)

    def send(self, data: bytes) -> None:
        """Publish the bytes of one message."""
        self._publisher.publish(data)

    def close(self) -> None:
        """End the publication."""
        self._node.destroy_publisher(self._publisher)
