"""The robot's topics, actions and services, as the nodes of its domain tell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from rclpy.action import get_action_names_and_types
from rclpy.node import Node, NodeNameNonExistentError

from robots.shared import wire
from robots.shared.graph import INSPECTOR, SystemState
from robots.shared.texts import MOST_NODES, MOST_TOPICS, NAME, cut

WITHIN_ACTION = "/_action/"
HIDDEN = "/_"  # begins a part of a name that people do not see
# Services that each node has for its parameters: people use parameters instead.
OF_PARAMETERS = ("rcl_interfaces/srv/", "type_description_interfaces/srv/")
MOST_ASKED = 500  # nodes

Listed = list[tuple[str, list[str]]]


def graph(node: Node, seq: int) -> wire.Graph:
    """Return all topics, actions and services of the domain, sorted by name."""
    nodes = list(_nodes(node))
    publishers = _by_name(nodes, node.get_publisher_names_and_types_by_node)
    subscribers = _by_name(nodes, node.get_subscriber_names_and_types_by_node)
    servers = _by_name(nodes, node.get_service_names_and_types_by_node)
    types = {cut(name, NAME): kinds[0] for name, kinds in _sorted(node.get_topic_names_and_types())}
    topics = [
        wire.TopicRow(name, cut(kind, NAME), publishers[name], subscribers[name])
        for name, kind in types.items()
        if publishers[name] or subscribers[name]
    ]
    actions = [
        wire.ActionRow(cut(name, NAME), cut(kinds[0], NAME))
        for name, kinds in _sorted(get_action_names_and_types(node))
        if f"{name}{WITHIN_ACTION}send_goal" in servers
    ]
    return wire.Graph(topics, actions, [wire.ServiceRow(*one) for one in _services(node, servers)], seq)


def published(node: Node) -> SystemState:
    """Return the publishers of all topics but hidden ones, such as those of actions, and their types."""
    publishers = _by_name(_nodes(node), node.get_publisher_names_and_types_by_node)
    types = {cut(name, NAME): kinds[0] for name, kinds in _sorted(node.get_topic_names_and_types())}
    shown = {name: found for name, found in publishers.items() if HIDDEN not in name}
    return SystemState(shown, {}, types, {})


def services(node: Node) -> dict[str, str]:
    """Return the types of all services but those of actions, by name."""
    found = _sorted(node.get_service_names_and_types())
    return {name: kinds[0] for name, kinds in found if WITHIN_ACTION not in name}


def names_of(node: Node) -> list[str]:
    """Return the names of all nodes, sorted."""
    return sorted(f"{within.rstrip('/')}/{name}" for name, within in _nodes(node))


def _services(node: Node, servers: dict[str, list[str]]) -> Iterator[tuple[str, str]]:
    for name, kind in services(node).items():
        if servers[name] and not kind.startswith(OF_PARAMETERS):
            yield cut(name, NAME), servers[name][0]


def _nodes(node: Node) -> Iterable[tuple[str, str]]:
    """Return the names and namespaces of the robot's nodes and other consoles', each once."""
    found = set(node.get_node_names_and_namespaces()[:MOST_ASKED])
    return sorted((name, within) for name, within in found if not f"/{name}".startswith(INSPECTOR))


def _by_name(
    nodes: Iterable[tuple[str, str]], listed: Callable[[str, str], Listed]
) -> defaultdict[str, list[str]]:
    """Return the nodes of each topic or service."""
    found: defaultdict[str, list[str]] = defaultdict(list)
    for name, within in nodes:
        with suppress(NodeNameNonExistentError):  # it has just left
            for one, _ in listed(name, within)[:MOST_TOPICS]:
                if len(found[cut(one, NAME)]) < MOST_NODES:
                    found[cut(one, NAME)].append(cut(f"{within.rstrip('/')}/{name}", NAME))
    return found


def _sorted(listed: Listed) -> Listed:
    return sorted((name, kinds) for name, kinds in listed if kinds)[:MOST_TOPICS]
