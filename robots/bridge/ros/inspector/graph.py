"""The robot's topics, actions, services and parameters, as its master lists them."""

from __future__ import annotations

import math
import xmlrpc.client
from collections.abc import Iterator
from typing import Any

import msgspec

from robots.bridge.ros.inspector.declined import Declined
from robots.shared import wire
from robots.shared.graph import INSPECTOR
from robots.shared.messages.fields import BadField
from robots.shared.ros.master import Master
from robots.shared.sentences import say
from robots.shared.texts import MOST_TOPICS, NAME, cut

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


# --- parameters ----------------------------------------------------------------------------------


def parameter_names(master: Master, seq: int) -> wire.Parameters:
    names = [cut(str(name), NAME) for name in master.call("getParamNames")[:MOST_TOPICS]]
    return wire.Parameters(sorted(names), seq)


def parameter(master: Master, name: str, seq: int, whole: bool = False) -> wire.Parameter:
    """Return a value, or the tree below `name`. Raises MasterError or Declined."""
    _require_parameter(master, name)
    value = _plain(master.parameter(name), LARGEST_WHOLE if whole else LONGEST_TEXT)
    size = len(msgspec.json.encode(value))
    if size > LARGEST_VALUE and not whole:
        text = say(
            "{name} is too large to be shown ({size} bytes): ask for a branch of it.", name=name, size=size
        )
        raise Declined("too_large", text, bytes=size, limit_bytes=LARGEST_VALUE)
    return wire.Parameter(name, value, seq)


def all_parameters(master: Master, seq: int) -> wire.Parameter:
    """Return the tree of all parameters, whole."""
    return wire.Parameter("/", _plain(master.parameter("/"), LARGEST_WHOLE), seq)


def set_parameter(master: Master, name: str, value: Any, seq: int) -> wire.Parameter:
    """Set a parameter and return the master's new value. Raises BadField for values that XML-RPC cannot carry."""
    try:
        xmlrpc.client.dumps((value,))
    except (TypeError, OverflowError) as error:
        raise BadField(
            name, "{path}: a parameter is a text, a number, true or false, or made of these."
        ) from error
    master.call("setParam", name, value)
    return parameter(master, name, seq)


def delete_parameter(master: Master, name: str, seq: int) -> wire.Parameter:
    """Delete a parameter, or the tree below it. Raises MasterError or Declined."""
    _require_parameter(master, name)
    master.call("deleteParam", name)
    return wire.Parameter(name, None, seq)


def _require_parameter(master: Master, name: str) -> None:
    if not master.call("hasParam", name):
        raise Declined("no_parameter", say("The robot has no parameter {name}.", name=name), name=name)


def _plain(value: Any, longest: int) -> Any:
    """Convert a value for JSON: XML-RPC also has NaN, dates and bytes. Texts are cut at `longest` characters."""
    match value:
        case dict():
            return {str(key): _plain(inner, longest) for key, inner in value.items()}
        case list() | tuple():
            return [_plain(inner, longest) for inner in value]
        case str() if len(value) > longest:
            return f"{value[:longest]}… ({len(value)} characters)"
        case float() if not math.isfinite(value):
            return str(value)
        case None | bool() | int() | float() | str():
            return value
        case _:
            return str(value)
