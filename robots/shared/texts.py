"""Length limits of texts from a robot's network; sizes in words. Longer texts are cut on arrival, with an ellipsis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import TypeVar

NAME = 200  # characters of a node's, topic's, type's, frame's, joint's or goal's name
TITLE = 100  # of a motion's name, title and group
SENTENCE = 300  # a reason of a failure, or an action's last words
PARAGRAPH = 1000  # of a motion's description
SAID = 2000  # a spoken text as the robot reports it
ANSWER = 4096  # of one text in an answer of a master or node
DESCRIPTION = 8_000_000  # of one text in a parameter: the robot's description

MOST_TOPICS = 5000  # of a robot, as its master lists them
MOST_NODES = 100  # on one topic
MOST_NAMED = 10  # names that a page shows
MOST_MOTIONS = 200  # of one action
MOST_GOALS = 100  # of one action, in one status

_Item = TypeVar("_Item")


def cut(text: str, most: int) -> str:
    """Cut a text to `most` characters. ROS names have no ellipsis, so a cut name never equals a real name."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def books(entries: Iterable[tuple[str, Sequence[str]]]) -> dict[str, list[str]]:
    """Return the names of nodes by topic or service, all cut. Only the first topics and nodes are kept."""
    found: dict[str, list[str]] = {}
    for name, nodes in entries:
        if len(found) >= MOST_TOPICS:
            break
        found[cut(name, NAME)] = [cut(node, NAME) for node in nodes[:MOST_NODES]]
    return found


def cut_types(entries: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return types by topic, both cut."""
    first = islice(entries, 2 * MOST_TOPICS)
    return {cut(topic, NAME): cut(type_name, NAME) for topic, type_name in first}


def named(names: Sequence[str], most: int = MOST_NAMED) -> list[str]:
    """Return the first names, and the number of the others: "+2"."""
    others = len(names) - most
    return [*names[:most], f"+{others}"] if others > 0 else [*names]


def most_of(entries: Mapping[str, _Item], ours: str) -> dict[str, _Item]:
    """Return at most `MOST_GOALS` of these goals, with names cut; names that begin with `ours` come first."""
    own_first = sorted(entries.items(), key=lambda item: not item[0].startswith(ours))
    return {cut(name, NAME): item for name, item in own_first[:MOST_GOALS]}


def size_text(size: float) -> str:
    """Return a number of bytes as a text for people."""
    for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= unit:
            return f"{size / unit:.3g} {name}"
    return f"{size:.0f} bytes"
