"""The robot's description (URDF), which its robot_state_publisher publishes once and keeps."""

from __future__ import annotations

from typing import Any

from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.participant import Participant, Subscription
from robots.bridge.ros2.qos import kept
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.texts import DESCRIPTION
from robots.shared.unreachable import Unreachable


class DescriptionTopic:
    """The topic. `text` is None until the description has come."""

    def __init__(self, participant: Participant, graph: Graph, topic: str) -> None:
        self._participant, self._graph, self._topic = participant, graph, topic
        self._qos: Any = None
        self._subscription: Subscription | None = None
        self.text: str | None = None

    def read(self) -> str | None:
        """Return the description; None: nobody publishes one. Raises `Unreachable` until it has come."""
        publishers = self._graph.publishers(self._topic)
        self._follow(publishers)
        if self.text is None and publishers:
            raise Unreachable(self._topic)
        return self.text

    def _follow(self, publishers: list[TopicEndpointInfo]) -> None:
        """Subscribe in the way that all publishers offer."""
        qos = kept(one.qos_profile for one in publishers)
        if publishers and qos != self._qos:
            if self._subscription is not None:
                self._subscription.unregister()
            self._qos = qos
            self._subscription = self._participant.listen(self._topic, "std_msgs/msg/String", self._take, qos)

    def _take(self, raw: bytes, _info: Any) -> None:
        message = Cdr(raw)
        length = message.number()
        text = bytes(message.data(length)[: length - 1]).decode(errors="replace")[:DESCRIPTION]
        if text != self.text:
            self.text = text
