"""Definitions as rosapi's `TypeDef` messages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from robots.shared.messages.fields import FLOATS, INTEGERS, STAMPS
from robots.shared.wire import Described, Field

# A publisher may send any text: each takes time in proportion to it
_EMBEDDED = re.compile(r"^MSG:[ \t]*([^\s/]+/[^\s/]+)[ \t]*$", re.MULTILINE)
_CONSTANT = re.compile(r"^[ \t]*([a-z0-9]+)[ \t]+([A-Za-z]\w*)[ \t]*=(.*)$", re.MULTILINE)


def typedefs(described: Described) -> list[dict[str, Any]]:
    """Return the `TypeDef` of a definition, followed by those of the types within it."""
    own, *embedded = _EMBEDDED.split(described.text)
    texts = {described.type: own, **dict(zip(embedded[::2], embedded[1::2], strict=True))}
    found: dict[str, dict[str, Any]] = {}
    for type_, fields in [(described.type, described.fields), *_nested(described.fields)]:
        if type_ not in found:
            found[type_] = _time(type_) if type_ in STAMPS else _typedef(type_, fields, texts.get(type_, ""))
    return list(found.values())


def _nested(fields: Sequence[Field]) -> Iterator[tuple[str, Sequence[Field]]]:
    for field in fields:
        if not _is_plain(field):
            yield field.type, field.fields
            yield from _nested(field.fields)


def _typedef(type_: str, fields: Sequence[Field], text: str) -> dict[str, Any]:
    constants = [(name, _value(kind, value)) for kind, name, value in _CONSTANT.findall(text)]
    return {
        "type": type_,
        "fieldnames": [field.name for field in fields],
        "fieldtypes": [field.type for field in fields],
        # In rosapi -1: no array, 0: any length
        "fieldarraylen": [-1 if field.array is None else max(field.array, 0) for field in fields],
        "examples": [_example(field) for field in fields],
        "constnames": [name for name, _ in constants],
        "constvalues": [value for _, value in constants],
    }


def _time(type_: str) -> dict[str, Any]:
    return {
        "type": type_,
        "fieldnames": list(STAMPS[type_].names),
        "fieldtypes": ["int32", "int32"],
        "fieldarraylen": [-1, -1],
        "examples": ["0", "0"],
        "constnames": [],
        "constvalues": [],
    }


def _is_plain(field: Field) -> bool:
    return field.type in INTEGERS or field.type in FLOATS or field.type == "string"


def _example(field: Field) -> str:
    if field.array is not None:
        return "[]"
    if field.type in FLOATS:
        return "0.0"
    if field.type == "string":
        return ""
    return ("False" if field.type == "bool" else "0") if _is_plain(field) else "{}"


def _value(kind: str, text: str) -> str:
    """Return a constant's value: after a number may follow a comment, which in a text is part of the value."""
    return (text if kind == "string" else text.split("#")[0]).strip()
