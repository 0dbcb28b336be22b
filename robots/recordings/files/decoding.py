"""Values of recorded messages: JSON of the console's own channels, and messages of ROS by their definitions."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from mcap.records import Channel, Schema
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

MOST_FIELDS = 400  # names of one topic that are offered
DEEPEST = 8
_NUMBERS = frozenset(
    {"bool", "float32", "float64", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
)
_STEP = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]")


class UnknownType(Exception):
    """Raised for a message whose definition cannot be read."""


class Decoder:
    """Reads the messages of one channel. Raises `UnknownType`."""

    def __init__(self, channel: Channel, schema: Schema | None) -> None:
        self.type = schema.name if schema else ""
        self._fields: Callable[[], Iterator[str]] = lambda: iter(())
        if channel.message_encoding == "json":
            self._decode: Callable[[bytes], Any] = msgspec.json.decode
        elif channel.message_encoding in ("ros1", "cdr") and schema is not None:
            self._prepare(schema, channel.message_encoding)
        else:
            raise UnknownType(channel.message_encoding)

    def _prepare(self, schema: Schema, encoding: str) -> None:
        store = get_typestore(Stores.EMPTY)
        name = normalize_msgtype(schema.name)
        try:
            store.register(get_types_from_msg(schema.data.decode(), name))
            store.get_msgdef(name)
        except Exception as error:  # the library raises many kinds for a text that a robot sent
            raise UnknownType(schema.name) from error
        read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
        self._decode = lambda data: read(data, name)
        self._fields = lambda: _numbers(store.fielddefs, name, "", DEEPEST)

    def read(self, data: bytes) -> Any:
        """Decode a message. Raises `UnknownType` if its bytes do not fit the definition."""
        try:
            return self._decode(data)
        except Exception as error:
            raise UnknownType(self.type) from error

    def number_fields(self) -> list[str]:
        """Return paths of fields with one number, such as `twist.linear.x`; of an array the first element."""
        found = []
        for field in self._fields():
            found.append(field)
            if len(found) >= MOST_FIELDS:
                break
        return found


def number_at(message: Any, path: str) -> float | None:
    """Return the number at a path such as `ranges[10]`; None: there is no number."""
    for name, index in _STEP.findall(path):
        try:
            if index:
                message = message[int(index)]
            else:
                message = message[name] if isinstance(message, dict) else getattr(message, name)
        except (LookupError, AttributeError, TypeError):
            return None
    try:
        return float(message)
    except (TypeError, ValueError):
        return None


def _numbers(definitions: Any, name: str, before: str, deeper: int) -> Iterator[str]:
    if not deeper:
        return
    for field, (kind, detail) in definitions[name][1]:
        path = f"{before}{field}"
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (kind, detail), path = detail[0], f"{path}[0]"
        if kind == Nodetype.BASE and detail[0] in _NUMBERS:
            yield path
        elif kind == Nodetype.NAME:
            yield from _numbers(definitions, detail, f"{path}.", deeper - 1)
