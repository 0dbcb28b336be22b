"""Fits fields from a person or a program to the definition of a message. Pure.

Fields are nested, or have dotted keys, or both; array elements may be named by their number ("points.0.x"). A value
that does not fit raises `BadField` with the path of the field, written as ``points[0].x``.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from robots.shared.sentences import say
from robots.shared.wire import Field, Refusal

NOW = "now"  # as a time: the moment of sending
INTEGERS = {
    "bool": (0, 1),
    "byte": (-128, 127),
    "char": (0, 255),
    "int8": (-(2**7), 2**7 - 1),
    "uint8": (0, 2**8 - 1),
    "int16": (-(2**15), 2**15 - 1),
    "uint16": (0, 2**16 - 1),
    "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1),
    "uint64": (0, 2**64 - 1),
}
FLOATS = {"float32": 3.4028234663852886e38, "float64": math.inf}  # largest value
BYTES = ("uint8", "char")  # arrays of these may be given as base64, as rosbridge writes them


class StampKind(NamedTuple):
    """How a time or a duration is given: the names of seconds and nanoseconds, and their types."""

    names: tuple[str, str]
    whole: str
    part: str
    has_now: bool


STAMPS = {
    "time": StampKind(("secs", "nsecs"), "uint32", "uint32", has_now=True),
    "duration": StampKind(("secs", "nsecs"), "int32", "int32", has_now=False),
    "builtin_interfaces/Time": StampKind(("sec", "nanosec"), "int32", "uint32", has_now=True),
    "builtin_interfaces/Duration": StampKind(("sec", "nanosec"), "int32", "uint32", has_now=False),
}
MAX_DEPTH = 24  # levels of nesting
MAX_ARRAY = 10_000  # elements; the limit of a message to the console is lower


class BadField(ValueError):
    """A field that the definition does not have, or a value that does not fit. `refusal` is for people."""

    def __init__(self, path: str, text: str, given: Any = None, **figures: Any) -> None:
        sentence = say(text, path=path, given=_describe(given), **figures)
        super().__init__(sentence)
        self.refusal = Refusal("bad_field", sentence, "wire", {"path": path})


def fit_fields(definition: Sequence[Field], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return `given` as nested values of the definition's types, with constants' names replaced.

    Missing fields stay missing. Raises `BadField`.
    """
    return _message(definition, given, "")


def _message(definition: Sequence[Field], given: Any, path: str) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise BadField(path, "{path}: the fields of a message are needed, not {given}.", given)
    known = {field.name: field for field in definition}
    found = {}
    for name, value in _nested(given).items():
        inner = f"{path}.{name}" if path else str(name)
        if name not in known:
            there = ", ".join(known) or say("none")
            raise BadField(inner, "There is no field {path}; the fields are: {there}.", there=there)
        found[name] = _field(known[name], value, inner)
    return found


def _field(field: Field, given: Any, path: str) -> Any:
    if field.array is None:
        return _one(field, given, path)
    values = _bytes(given, path) if isinstance(given, str) and field.type in BYTES else _elements(given, path)
    if field.array >= 0 and len(values) != field.array:
        raise BadField(
            path, "{path}: exactly {wanted} values, not {count}.", wanted=field.array, count=len(values)
        )
    if len(values) > MAX_ARRAY:
        raise BadField(path, "{path}: at most {most} values, not {count}.", most=MAX_ARRAY, count=len(values))
    return [_one(field, value, f"{path}[{number}]") for number, value in enumerate(values)]


def _bytes(given: str, path: str) -> Sequence[int]:
    try:
        return list(base64.b64decode(given, validate=True))
    except binascii.Error as error:
        raise BadField(path, "{path}: an array, or its bytes in base64, not {given}.", given) from error


def _elements(given: Any, path: str) -> Sequence[Any]:
    if isinstance(given, Mapping):
        wanted = [str(number) for number in range(len(given))]
        if set(given) != set(wanted):
            raise BadField(path, "{path}: an array’s elements are numbered from 0, without a gap.")
        return [given[number] for number in wanted]
    if not isinstance(given, list | tuple):
        raise BadField(path, "{path}: an array is needed, not {given}.", given)
    return given


def _one(field: Field, given: Any, path: str) -> Any:
    if isinstance(given, str) and field.type != "string" and given in field.constants:
        return field.constants[given]
    if field.type == "bool":
        return _truth(given, path)
    if field.type in INTEGERS:
        return _whole(field.type, given, path)
    if field.type in FLOATS:
        return _number(field.type, given, path)
    if field.type in STAMPS:
        return _stamp(field.type, given, path)
    if field.type == "string":
        return _text(given, path)
    return _message(field.fields, given, path)


def _truth(given: Any, path: str) -> bool:
    if given is True or given is False or (type(given) is int and given in (0, 1)):
        return bool(given)
    raise BadField(path, "{path}: true or false, not {given}.", given)


def _whole(type_name: str, given: Any, path: str) -> int:
    low, high = INTEGERS[type_name]
    if isinstance(given, float) and given.is_integer():
        given = int(given)
    if isinstance(given, bool) or not isinstance(given, int):
        raise BadField(path, "{path}: a whole number ({type}), not {given}.", given, type=type_name)
    if not low <= given <= high:
        raise BadField(
            path,
            "{path}: {type} goes from {low} to {high}; {given} does not fit.",
            given,
            type=type_name,
            low=low,
            high=high,
        )
    return given


def _number(type_name: str, given: Any, path: str) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise BadField(path, "{path}: a number ({type}), not {given}.", given, type=type_name)
    try:
        value = float(given)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise BadField(path, "{path}: a finite number is needed.")
    if abs(value) > FLOATS[type_name]:
        raise BadField(path, "{path}: {given} is too large for {type}.", given, type=type_name)
    return value


def _stamp(type_name: str, given: Any, path: str) -> Any:
    """Return seconds and nanoseconds by their names; a time may be "now"."""
    kind = STAMPS[type_name]
    whole, part = kind.names
    if given == NOW and kind.has_now:
        return NOW
    if isinstance(given, Mapping):
        if not set(given) <= {whole, part}:
            raise BadField(
                path, "{path}: a {type} has {whole} and {part}.", type=type_name, whole=whole, part=part
            )
        seconds = _whole(kind.whole, given.get(whole, 0), f"{path}.{whole}")
        nanoseconds = _whole(kind.part, given.get(part, 0), f"{path}.{part}")
        if not 0 <= nanoseconds < 1_000_000_000:
            raise BadField(f"{path}.{part}", "{path}: from 0 to 999999999.")
        return {whole: seconds, part: nanoseconds}
    if isinstance(given, bool) or not isinstance(given, int | float):
        figures = {"whole": whole, "part": part}
        if kind.has_now:
            raise BadField(
                path, '{path}: seconds, or {whole} and {part} or "now", not {given}.', given, **figures
            )
        raise BadField(path, "{path}: seconds, or {whole} and {part}, not {given}.", given, **figures)
    low, high = INTEGERS[kind.whole]
    if not low <= given < high + 1:  # false for NaN and infinities as well
        raise BadField(
            path,
            "{path}: a {type} has from {low} to {high} seconds, not {given}.",
            given,
            type=type_name,
            low=low,
            high=high,
        )
    complete, rest = divmod(given, 1)
    nanoseconds = round(rest * 1_000_000_000)
    return {whole: int(complete) + nanoseconds // 1_000_000_000, part: nanoseconds % 1_000_000_000}


def _text(given: Any, path: str) -> str:
    if not isinstance(given, str):
        raise BadField(path, "{path}: a text, not {given}.", given)
    if "\0" in given:
        raise BadField(path, "{path}: a text without null characters.")
    return given


def _nested(given: Mapping[str, Any]) -> dict[str, Any]:
    """Resolve dotted keys: merge "a.b" into "a"."""
    found: dict[str, Any] = {}
    for key, value in given.items():
        _put(found, str(key).split("."), value, "", MAX_DEPTH)
    return found


def _put(into: dict[str, Any], names: list[str], value: Any, path: str, deeper: int) -> None:
    name, *rest = names
    path = f"{path}.{name}" if path else name
    if not deeper:
        raise BadField(path, "{path}: the fields are nested too deeply.")
    if rest:
        value = {".".join(rest): value}
    if isinstance(value, Mapping):
        inner = into.setdefault(name, {})
        if not isinstance(inner, dict):
            raise BadField(path, "{path} is given twice.")
        for key, part in value.items():
            _put(inner, str(key).split("."), part, path, deeper - 1)
    elif name in into:
        raise BadField(path, "{path} is given twice.")
    else:
        into[name] = value


def _describe(value: Any) -> str:
    """Describe a value in a few words, for a person."""
    match value:
        case None:
            return say("nothing")
        case bool():
            return str(value).lower()
        case Mapping():
            return say("a dictionary")
        case list() | tuple():
            return say("an array")
        case str():
            return say("the text “{text}”", text=value[:20])
        case int() if value.bit_length() > 128:  # Python refuses to print integers with some thousand digits
            return say("a very large number")
        case _:
            return str(value)[:40]
