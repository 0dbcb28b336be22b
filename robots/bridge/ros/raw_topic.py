"""A topic that is read as bytes, with what its publishers say of them: for tap and recorder."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

import rospy

from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.sensors.raw_bytes import BUFFER_BYTES
from robots.bridge.tap.arrivals import Kind
from robots.bridge.tap.raw_topic import MOST_PUBLISHERS, Speaker, Take
from robots.bridge.topics.inspector.declined import Declined
from robots.shared.texts import NAME, cut


class RawTopic:
    """One subscribed topic. `take` gets each message on rospy's threads, one for each publisher.

    `seconds` tells them how long to rest before each read; of what came then, `queue` messages are kept (None: all).
    """

    def __init__(
        self,
        topic: str,
        definitions: Definitions,
        take: Take,
        seconds: Callable[[], float],
        queue: int | None,
        buffer_bytes: int = BUFFER_BYTES,
    ) -> None:
        self._definitions = definitions
        self._take = take
        self._lock = threading.Lock()
        self._speakers: dict[tuple[str, Kind], Speaker] = {}
        pause(topic, seconds)
        self._subscriber = rospy.Subscriber(
            topic,
            rospy.AnyMsg,
            lambda message: self._take(self._speaker(message._connection_header), message._buff),
            queue_size=queue,
            buff_size=buffer_bytes,
            tcp_nodelay=True,
        )

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()

    def speakers(self) -> list[Speaker]:
        """Return the publishers that are connected now."""
        implementation = self._subscriber.impl
        connections = [] if implementation is None else list(implementation.connections)
        return [self._speaker(each.header) for each in connections if each.type is not None]

    def _speaker(self, header: Mapping[str, Any]) -> Speaker:
        kind = Kind(cut(str(header.get("type", "")), NAME), cut(str(header.get("md5sum", "")), NAME))
        key = str(header.get("callerid", "")), kind
        found = self._speakers.get(key)
        if found is None:
            found = self._described(kind, dict(header))
            with self._lock:
                if len(self._speakers) >= MOST_PUBLISHERS:
                    self._speakers.clear()
                self._speakers[key] = found
        return found

    def _described(self, kind: Kind, header: dict[str, str]) -> Speaker:
        definition, refusal = None, None
        try:
            definition = self._definitions.of_connection(header)
        except Declined as error:
            refusal = error.refusal
        node, text = str(header.get("callerid", "")), str(header.get("message_definition", ""))
        return Speaker(node, kind, header.get("latching") == "1", text, definition, refusal)
