"""Subscriptions and publications of the inspector, of any type that is installed."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node as RosNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.bridge.ros2.message_types import TypeUnknown, message_class
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.raw_topic import RawTopic
from robots.bridge.tap.raw_topic import Speaker
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.side import Received, Talker
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition
from robots.shared.sentences import reason_of
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


class Node:
    """Subscribes and publishes in the robot's domain."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant

    def subscribe(self, topic: str, take: Callable[[Received], None]) -> Source:
        """Subscribe to a topic with the type of its publishers."""
        return Source(self._participant, topic, take)

    def advertise(self, topic: str, definition: Definition) -> Writer:
        """Publish messages of an installed type."""
        return Writer(self._participant.node, topic, definition)

    def leave(self) -> None:
        """Leave the domain."""
        self._participant.close(LEAVE_S)


class Source:
    """A subscribed topic."""

    def __init__(self, participant: Participant, topic: str, take: Callable[[Received], None]) -> None:
        self._take = take
        self._refusal: Refusal | None = None
        # It counts the messages, so that it takes them all
        self._topic = RawTopic(participant, topic, self._receive, QUEUE, ignored=INSPECTOR, spares=False)
        self.talkers()

    def talkers(self) -> list[Talker]:
        """Return the publishers; subscribe as they offer now."""
        speakers = self._topic.speakers()
        unknown = (one.refusal for one in speakers if one.refusal and one.refusal.code == "type_unknown")
        self._refusal = next(unknown, None)
        return [Talker(one.node, *one.kind) for one in speakers]

    def refusal(self) -> Refusal | None:
        """Return a refusal for a type whose package is not installed."""
        return self._refusal

    def close(self) -> None:
        """Unsubscribe."""
        self._topic.close()

    def _receive(self, speaker: Speaker, data: bytes) -> None:
        self._take(Received(speaker.kind.type, data, partial(_definition, speaker)))


def _definition(speaker: Speaker) -> Definition:
    """Return what a publisher's messages have. Raises Declined for another version of a type, too."""
    if speaker.refusal:
        raise declined.unknown_type(speaker.kind.type, speaker.refusal.text)
    return known(speaker.kind.type)


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
