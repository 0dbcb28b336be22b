"""Topics that are subscribed as their publishers offer them, and again when these offer something else."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

from rclpy.qos import QoSProfile

from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.participant import Participant, Subscription, Take

Choose = Callable[[Iterable[QoSProfile]], QoSProfile]  # a function of `robots.bridge.ros2.qos`


class FollowedTopics:
    """Those of one participant. Thread-safe."""

    def __init__(self, participant: Participant, graph: Graph) -> None:
        self._participant, self._graph = participant, graph
        self._lock = threading.Lock()
        self._topics: tuple[FollowedTopic, ...] = ()

    def listen(self, topic: str, kind: str, take: Take, choose: Choose) -> FollowedTopic:
        """Subscribe until `unregister`."""
        found = FollowedTopic(self._participant, self._graph, topic, kind, take, choose, self._forget)
        with self._lock:
            self._topics = (*self._topics, found)
        return found

    def follow(self) -> None:
        """Look at what publishers offer now."""
        for topic in self._topics:
            topic.follow()

    def _forget(self, left: FollowedTopic) -> None:
        with self._lock:
            self._topics = tuple(one for one in self._topics if one is not left)


class FollowedTopic:
    """One topic."""

    def __init__(
        self,
        participant: Participant,
        graph: Graph,
        topic: str,
        kind: str,
        take: Take,
        choose: Choose,
        closed: Callable[[FollowedTopic], None],
    ) -> None:
        self._participant, self._graph = participant, graph
        self._topic, self._kind, self._take = topic, kind, take
        self._choose, self._closed = choose, closed
        self._lock = threading.Lock()
        self._is_open = True
        self._asked: QoSProfile | None = None
        self._subscription: Subscription | None = None
        self.publishers = 0
        self.follow()

    def follow(self) -> None:
        """Ask for what the publishers offer now."""
        offered = [
            one.qos_profile for one in self._graph.publishers(self._topic) if one.topic_type == self._kind
        ]
        wanted = self._choose(offered)
        with self._lock:
            self.publishers = len(offered)
            if not self._is_open or (self._asked is not None and (wanted == self._asked or not offered)):
                return
            before, self._asked = self._subscription, wanted
            self._subscription = self._participant.listen(self._topic, self._kind, self._take, wanted)
        if before is not None:
            before.unregister()

    def unregister(self) -> None:
        """End it."""
        with self._lock:
            self._is_open = False
            subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.unregister()
        self._closed(self)
