"""Publishers, subscribers and services of a robot, and how they changed. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from robots.shared import wire
from teleop.foxglove.protocol import encoded

Nodes = Mapping[str, list[str]]  # by topic or service


class ConnectionGraph(NamedTuple):
    """Nodes by what they publish, subscribe and serve."""

    published: Nodes
    subscribed: Nodes
    services: Nodes


def of(graph: wire.Graph) -> ConnectionGraph:
    """Return the connection graph of what a master lists."""
    return ConnectionGraph(
        {row.name: row.publishers for row in graph.topics if row.publishers},
        {row.name: row.subscribers for row in graph.topics if row.subscribers},
        {row.name: [row.node] for row in graph.services},
    )


def whole(graph: ConnectionGraph) -> str:
    """Return the message for a client that knows nothing yet."""
    return _message(ConnectionGraph({}, {}, {}), graph)


def update(before: ConnectionGraph, now: ConnectionGraph) -> str | None:
    """Return the message that leads from one graph to the next; None: nothing changed."""
    return None if before == now else _message(before, now)


def _message(before: ConnectionGraph, now: ConnectionGraph) -> str:
    topics = now.published.keys() | now.subscribed.keys()
    published = _changed(before.published, now.published, topics)
    subscribed = _changed(before.subscribed, now.subscribed, topics)
    services = _changed(before.services, now.services, set(now.services))
    return encoded(
        "connectionGraphUpdate",
        publishedTopics=[{"name": name, "publisherIds": nodes} for name, nodes in published],
        subscribedTopics=[{"name": name, "subscriberIds": nodes} for name, nodes in subscribed],
        advertisedServices=[{"name": name, "providerIds": nodes} for name, nodes in services],
        removedTopics=sorted((before.published.keys() | before.subscribed.keys()) - topics),
        removedServices=sorted(before.services.keys() - now.services.keys()),
    )


def _changed(before: Nodes, now: Nodes, names: set[str]) -> list[tuple[str, list[str]]]:
    """Return the nodes of each name that has others than before; none at all, if it has none any more."""
    return [(name, now.get(name, [])) for name in sorted(names) if before.get(name, []) != now.get(name, [])]
