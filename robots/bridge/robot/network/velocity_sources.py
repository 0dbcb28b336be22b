"""Which nodes can drive the base past the console: publishers of every velocity topic that leads to it. Pure."""

from __future__ import annotations

from collections.abc import Collection

from robots.shared.graph import SystemState, is_own
from robots.shared.texts import TITLE, cut, named

# Named topics, and nodes of each: the answer to a stop has them, too, and must stay small.
MOST_TOPICS = MOST_NODES = 3
VELOCITIES = frozenset(
    {
        "geometry_msgs/Twist",
        "geometry_msgs/TwistStamped",
        "geometry_msgs/msg/Twist",
        "geometry_msgs/msg/TwistStamped",
    }
)


def velocity_sources(system: SystemState, drive: str, odometry: str) -> dict[str, list[str]]:
    """Return the nodes that publish velocities for the base, by topic; the topics nearest to the base come first.

    The base's controller is the node that publishes odometry. Velocities reach it on topics that it listens to, and
    through nodes (such as twist_mux) between these and the `drive` topic. The console's own nodes and the controller
    are left out. Names of nodes that pass on the `drive` topic come last.
    """
    graph = _Graph(system)
    controllers = set(system.publishers.get(odometry, []))
    heard = {topic for node in controllers for topic in graph.heard(node)}
    reaching, relays = graph.leading_to(heard | {drive})
    muxes = {node for node in relays if drive in graph.heard(node)}
    passed_on = {topic for node in relays - controllers for topic in graph.sent(node)}
    found: dict[str, list[str]] = {}
    for topic in sorted(reaching, key=lambda topic: (topic not in passed_on, topic not in heard, topic)):
        nodes = {node for node in system.publishers.get(topic, []) if not is_own(node)} - controllers
        if nodes and len(found) < MOST_TOPICS:
            names = [cut(node, TITLE) for node in (*sorted(nodes - muxes), *sorted(nodes & muxes))]
            found[cut(topic, TITLE)] = named(names, MOST_NODES)
    return found


class _Graph:
    """Nodes and velocity topics of a robot."""

    def __init__(self, system: SystemState) -> None:
        velocities = {topic for topic, kind in system.types.items() if kind in VELOCITIES}
        self._publishers = {topic: set(system.publishers.get(topic, [])) for topic in velocities}
        self._subscribers = {topic: set(system.subscribers.get(topic, [])) for topic in velocities}

    def heard(self, node: str) -> set[str]:
        """Return the velocity topics that a node listens to."""
        return {topic for topic, nodes in self._subscribers.items() if node in nodes}

    def sent(self, node: str) -> set[str]:
        """Return the velocity topics that a node publishes."""
        return {topic for topic, nodes in self._publishers.items() if node in nodes}

    def leading_to(self, topics: Collection[str]) -> tuple[set[str], set[str]]:
        """Return these topics with all that nodes connect with them, and the nodes that pass velocities on."""
        reaching, relays = set(topics), set[str]()
        while True:
            nodes = {
                node
                for topic in reaching
                for node in self._publishers.get(topic, set()) | self._subscribers.get(topic, set())
                if not is_own(node) and self.heard(node) and self.sent(node)
            }
            if nodes == relays:
                return reaching, relays
            relays = nodes
            for node in nodes:
                reaching |= self.heard(node) | self.sent(node)
