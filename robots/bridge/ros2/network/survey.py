"""Who of a robot is in its domain, and what of it does not fit the console."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.network.graph import Graph, node_name
from robots.shared.configuration.bridge_config import Topics
from robots.shared.graph import is_own
from robots.shared.sentences import say


def is_there(graph: Graph, topics: Topics, drive: str) -> bool:
    """Return whether the robot publishes odometry, or listens to the drive topic."""
    return bool(_others(graph.publishers(topics.odometry.name)) or _others(graph.subscribers(drive)))


def problems(graph: Graph, drive: str) -> list[str]:
    """Return a sentence for each listener that wants old velocities too, which the console never keeps."""
    return [
        say(
            "{node} gets nothing on {topic}: it asks for durability transient local, the console offers volatile.",
            node=node_name(listener),
            topic=drive,
        )
        for listener in _others(graph.subscribers(drive))
        if listener.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    ]


def own_listeners(graph: Graph, topic: str) -> int:
    """Return how many of the console's own processes listen to a topic: they do not move."""
    return sum(is_own(node_name(one)) for one in graph.subscribers(topic))


def _others(endpoints: list[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
    return [one for one in endpoints if not is_own(node_name(one))]
