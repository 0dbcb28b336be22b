"""The robot's topics, actions, services and parameters, as its master lists them."""

from __future__ import annotations

from collections.abc import Iterator

from robots.shared import wire
from robots.shared.graph import INSPECTOR
from robots.shared.ros.master import Master

PARTS = ("goal", "cancel", "status", "feedback", "result")  # topics of an action
LARGEST_VALUE = 48 * 1024  # bytes of a parameter's JSON
LONGEST_TEXT = 16 * 1024  # characters of one text in a parameter
LARGEST_WHOLE = (
    8_000_000  # characters of a text that is asked for as a whole; the limit of an answer is lower
)


def graph(master: Master, seq: int) -> wire.Graph:
    """Return all topics, actions and services of the master, sorted by name."""
    system = master.system_state()
    publishers, subscribers = _of_the_robot(system.publishers), _of_the_robot(system.subscribers)
    topics = [
        wire.TopicRow(name, system.types.get(name, "*"), publishers.get(name, []), subscribers.get(name, []))
        for name in sorted(publishers.keys() | subscribers.keys())
    ]
    services = [
        wire.ServiceRow(name, nodes[0]) for name, nodes in sorted(_of_the_robot(system.services).items())
    ]
    return wire.Graph(topics, list(_actions(topics)), services, seq)


def _of_the_robot(books: dict[str, list[str]]) -> dict[str, list[str]]:
    found = {
        name: sorted(node for node in nodes if not node.startswith(INSPECTOR))
        for name, nodes in books.items()
    }
    return {name: nodes for name, nodes in found.items() if nodes}


def _actions(topics: list[wire.TopicRow]) -> Iterator[wire.ActionRow]:
    """Find the actions: all five topics of an action exist, and a node publishes its status."""
    rows = {topic.name: topic for topic in topics}
    for name in sorted(row.removesuffix("/goal") for row in rows if row.endswith("/goal")):
        parts = {part: rows.get(f"{name}/{part}") for part in PARTS}
        status = parts["status"]
        if all(parts.values()) and status and status.publishers:
            yield wire.ActionRow(name, _action_type(parts))


def _action_type(parts: dict[str, wire.TopicRow | None]) -> str:
    for part in ("goal", "result", "feedback"):
        row, ending = parts[part], part.capitalize()
        if row is not None and row.type.endswith(f"Action{ending}"):
            return row.type.removesuffix(ending)
    return "*"
