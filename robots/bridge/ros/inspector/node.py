"""The inspector's rospy node: started by the first subscription or publication."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import rospy

from robots.bridge.ros import child_node
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.tasks.publishing import immediate_publisher, publish
from robots.bridge.topics.inspector.side import Received, Talker
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition
from robots.shared.ros.master import Master, MasterError
from robots.shared.wire import Refusal

# a subscriber that does not read for this time is disconnected, so that it delays no other
SEND_PATIENCE_S = 0.3


def joined(config: BridgeConfig, master: Master, definitions: Definitions) -> Node:
    """Register at the master. Raises OSError or MasterError."""
    child_node.join(config, INSPECTOR)
    return Node(master, definitions)


class Node:
    """Subscribes and publishes at one robot. The process ends when the master dies."""

    def __init__(self, master: Master, definitions: Definitions) -> None:
        self._master = master
        self._definitions = definitions

    def subscribe(self, topic: str, take: Callable[[Received], None]) -> Source:
        """Subscribe to a topic of any type."""
        return Source(topic, take, self._definitions)

    def advertise(self, topic: str, definition: Definition) -> Writer:
        """Register a topic to publish on."""
        return Writer(topic, definition, self._master)

    def leave(self) -> None:
        """Unregister from the master."""
        child_node.leave()


class Source:
    """A subscribed topic."""

    def __init__(self, topic: str, take: Callable[[Received], None], definitions: Definitions) -> None:
        self._take = take
        self._definitions = definitions
        # No queue size: with one, rospy drops messages before they are counted. Here no message waits.
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._on_message)

    def talkers(self) -> list[Talker]:
        """Return the publishers that are connected, by the headers of their connections."""
        return [
            Talker(one.callerid_pub, one.type, one.md5sum or "") for one in self._subscriber.impl.connections
        ]

    def refusal(self) -> Refusal | None:
        """Return None: each message has the definition of its publisher."""

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()

    def _on_message(self, message: rospy.AnyMsg) -> None:
        header = message._connection_header
        definition = partial(self._definitions.of_connection, header)
        self._take(Received(header.get("type", "*"), message._buff, definition))


class Writer:
    """A topic on which the node publishes."""

    def __init__(self, topic: str, definition: Definition, master: Master) -> None:
        self._topic = topic
        self._master = master
        self._publisher = immediate_publisher(topic, _message_class(definition), SEND_PATIENCE_S)

    def await_listeners(self, within_s: float) -> None:
        """Wait until those that the master knows are connected."""
        deadline_s = time.monotonic() + within_s
        try:
            known = len(self._master.system_state().subscribers.get(self._topic, []))
        except MasterError:
            return
        while self._publisher.get_num_connections() < known and time.monotonic() < deadline_s:
            time.sleep(0.01)

    def send(self, data: bytes) -> None:
        """Publish the bytes of one message."""
        publish(self._publisher, self._publisher.data_class().deserialize(data))

    def close(self) -> None:
        """Unregister the topic."""
        self._publisher.unregister()


def _message_class(definition: Definition) -> type[rospy.AnyMsg]:
    """Return a message class with the attributes that rospy needs; the inspector packs the bytes."""
    names = {
        "_type": definition.type,
        "_md5sum": definition.md5,
        "_full_text": definition.text,
        "__slots__": [],
    }
    return type("Message", (rospy.AnyMsg,), names)
