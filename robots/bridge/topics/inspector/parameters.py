"""Answers about the robot's parameters."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from robots.bridge.topics.inspector.declined import Declined, no_parameter
from robots.bridge.topics.inspector.side import InspectorSide
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.texts import MOST_TOPICS, NAME, cut

LARGEST_VALUE = 48 * 1024  # bytes of a parameter's JSON
LONGEST_TEXT = 16 * 1024  # characters of one text in a parameter
# characters of a text that is asked for as a whole; the limit of an answer is lower
LARGEST_WHOLE = 8_000_000


def names(side: InspectorSide, seq: int) -> wire.Parameters:
    return wire.Parameters(sorted(cut(name, NAME) for name in side.parameter_names()[:MOST_TOPICS]), seq)


def parameter(side: InspectorSide, name: str, seq: int, whole: bool = False) -> wire.Parameter:
    """Return a value, or the tree below `name`. Raises Declined."""
    require(side, name)
    value = _plain(side.parameter(name), LARGEST_WHOLE if whole else LONGEST_TEXT)
    size = len(msgspec.json.encode(value))
    if size > LARGEST_VALUE and not whole:
        text = say(
            "{name} is too large to be shown ({size} bytes): ask for a branch of it.", name=name, size=size
        )
        raise Declined("too_large", text, bytes=size, limit_bytes=LARGEST_VALUE)
    return wire.Parameter(name, value, seq)


def everything(side: InspectorSide, seq: int) -> wire.Parameter:
    """Return the tree of all parameters, whole."""
    return wire.Parameter("/", _plain(side.parameter("/"), LARGEST_WHOLE), seq)


def require(side: InspectorSide, name: str) -> None:
    """Refuse a parameter that the robot does not have. Raises Declined."""
    if not side.has_parameter(name):
        raise no_parameter(name)


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
