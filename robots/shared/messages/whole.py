"""Reads whole messages by their definition, for programs. Pure.

`packing` reads a part of a message, for people. Arrays of numbers are read at once, so that a picture or a map costs
little more than its bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np

from robots.shared.messages.fields import FLOATS, INTEGERS, STAMPS, StampKind
from robots.shared.messages.packing import CODES, MAX_STEPS, Broken, TooLarge, check_end, check_head
from robots.shared.messages.serialization import ROS1, Serialization
from robots.shared.sentences import say
from robots.shared.wire import Field

_LENGTH = struct.Struct("<I")
_BYTES = ("uint8", "char")  # base64 in JSON, bytes in CBOR
# Tags of typed arrays (RFC 8746), little-endian
_CBOR_TAGS = {
    "uint16": 69,
    "uint32": 70,
    "uint64": 71,
    "byte": 72,
    "int8": 72,
    "int16": 77,
    "int32": 78,
    "int64": 79,
    "float32": 85,
    "float64": 86,
}

MOST_SHORTENED = 10_000  # float32 of an array: more would take longer than they save
_POWERS = 10.0 ** np.arange(23)  # those that float64 has exactly

Numbers = Callable[[str, memoryview], Any]  # the value of an array of this type with these bytes
Encode = Callable[[bytes], bytes]  # from a message's bytes


class _Cursor:
    """A position in one message's bytes."""

    def __init__(self, data: bytes, serialization: Serialization) -> None:
        self.data = memoryview(data)
        self.at = self._begin = len(serialization.head)
        self._step_of_length = serialization.step_of(4)
        self._steps_left = MAX_STEPS

    @property
    def phase(self) -> int:
        """The place among eight bytes, on which gaps between numbers depend."""
        return (self.at - self._begin) & 7

    def step(self, size: int, multiple: int = 1) -> int:
        """Advance by `size` bytes, which begin at a multiple of this; return where they begin."""
        begin = self.at + (self._begin - self.at) % multiple
        self.at = begin + size
        if self.at > len(self.data):
            raise Broken(say("The message ends after {count} bytes, within a field.", count=len(self.data)))
        return begin

    def count(self, parts: int = 1) -> None:
        """Count parts that take time each."""
        self._steps_left -= parts
        if self._steps_left < 0:
            raise TooLarge(say("The message has too many parts to be sent in this form."))

    def length(self) -> int:
        """Read the length prefix."""
        size: int = _LENGTH.unpack_from(self.data, self.step(4, self._step_of_length))[0]
        return size

    def slice(self, size: int, multiple: int = 1) -> memoryview:
        """Read `size` bytes, which begin at a multiple of this."""
        begin = self.step(size, multiple)
        return self.data[begin : begin + size]


_Read = Callable[[_Cursor], Any]


def json_encoder(definition: Sequence[Field], serialization: Serialization = ROS1) -> Encode:
    """Return the encoder to JSON, as rosbridge does: NaN and infinities are null, bytes are base64.

    Only float32 have fewer digits.

    Raises `Broken` or `TooLarge`, as all encoders here.
    """
    read = _reader(definition, _Parts(serialization, _plain_numbers))
    encode = msgspec.json.Encoder().encode
    return lambda data: encode(read(data))


def cbor_encoder(definition: Sequence[Field], serialization: Serialization = ROS1) -> Encode:
    """Return the encoder to CBOR, as rosbridge does: arrays of numbers are typed arrays."""
    import cbor2  # here, because a bridge encodes none

    read = _reader(definition, _Parts(serialization, _tagged_numbers))
    return lambda data: cbor2.dumps(read(data))


def _plain_numbers(type_name: str, data: memoryview) -> Any:
    if type_name in _BYTES:
        return data  # msgspec writes base64
    values = np.frombuffer(data, dtype=np.dtype("<" + CODES[type_name]))
    if type_name == "float32" and len(values) <= MOST_SHORTENED:
        values = _fewest_digits(values)
    return values.tolist()


def _fewest_digits(values: Any) -> Any:
    """Return these float32 as float64 with fewer digits: 0.1 in place of 0.10000000149. They become the same float32.

    So the scan of a laser has a half to a third of the characters.
    """
    found = values.astype(np.float64)
    with np.errstate(all="ignore"):
        digits_before = np.floor(np.log10(np.abs(found)))
        for digits in (8, 7, 6):
            places = digits - 1 - digits_before
            possible = (places >= 0) & (places < len(_POWERS))
            scale = _POWERS[np.where(possible, places, 0).astype(np.intp)]
            shorter = np.rint(values * scale) / scale
            found = np.where(possible & (shorter.astype(np.float32) == values), shorter, found)
    return found


def _tagged_numbers(type_name: str, data: memoryview) -> Any:
    if type_name in _BYTES:
        return bytes(data)
    if type_name == "bool":
        return list(map(bool, data))
    import cbor2

    return cbor2.CBORTag(_CBOR_TAGS[type_name], bytes(data))


class _Parts(NamedTuple):
    """The parts of a definition's reader have these in common."""

    serialization: Serialization
    numbers: Numbers


def _reader(definition: Sequence[Field], parts: _Parts) -> Callable[[bytes], dict[str, Any]]:
    read_fields = _message(definition, parts)

    def read(data: bytes) -> dict[str, Any]:
        check_head(data, parts.serialization)
        cursor = _Cursor(data, parts.serialization)
        fields: dict[str, Any] = read_fields(cursor)
        check_end(cursor.at, len(data), parts.serialization)
        return fields

    return read


def _message(fields: Sequence[Field], parts: _Parts) -> _Read:
    if fields and all(_is_number(field) for field in fields):
        names, layouts = [field.name for field in fields], _structs(fields, parts.serialization)

        def read_numbers(cursor: _Cursor) -> dict[str, Any]:
            layout = layouts[cursor.phase]
            return dict(zip(names, layout.unpack_from(cursor.data, cursor.step(layout.size)), strict=True))

        return read_numbers
    readers = [(field.name, _field(field, parts)) for field in fields]
    nothing = 0 if fields else parts.serialization.nothing

    def read(cursor: _Cursor) -> dict[str, Any]:
        cursor.count()
        cursor.step(nothing)
        return {name: reader(cursor) for name, reader in readers}

    return read


def _is_number(field: Field) -> bool:
    return field.array is None and field.type in CODES


def _structs(fields: Sequence[Field], serialization: Serialization) -> list[struct.Struct]:
    """Return the layouts of these numbers, by the phase at which they begin."""
    return (
        [_struct(fields, serialization, phase) for phase in range(8)]
        if serialization.aligned
        else [_struct(fields, serialization, 0)] * 8
    )


def _struct(fields: Sequence[Field], serialization: Serialization, at: int) -> struct.Struct:
    layout = "<"
    for field in fields:
        width = struct.calcsize("<" + CODES[field.type])
        gap = -at % serialization.step_of(width)
        layout += "x" * gap + CODES[field.type]
        at += gap + width
    return struct.Struct(layout)


def _field(field: Field, parts: _Parts) -> _Read:
    if field.array is None:
        return _one(field, parts)
    length = field.array
    if field.type in INTEGERS or field.type in FLOATS:
        kind, width = field.type, struct.calcsize("<" + CODES[field.type])
        multiple = parts.serialization.step_of(width)

        def read_numbers(cursor: _Cursor) -> Any:
            size = _length(cursor, length) * width
            return parts.numbers(kind, cursor.slice(size, multiple if size else 1))

        return read_numbers
    if field.fields and all(_is_number(inner) for inner in field.fields):
        return _rows(field.fields, length, parts.serialization)
    one = _one(field, parts)

    def read(cursor: _Cursor) -> list[Any]:
        count = _length(cursor, length)
        cursor.count(count)
        return [one(cursor) for _ in range(count)]

    return read


def _rows(fields: Sequence[Field], length: int, serialization: Serialization) -> _Read:
    """Return the reader of an array of messages that are only numbers, such as points.

    A row ends with a number of the largest width and then the same bytes, wherever it began: so from the second on,
    all rows have the same gaps.
    """
    names, layouts = [field.name for field in fields], _structs(fields, serialization)

    def rows(cursor: _Cursor, count: int) -> list[dict[str, Any]]:
        layout = layouts[cursor.phase]
        data = cursor.slice(count * layout.size)
        return [dict(zip(names, row, strict=True)) for row in layout.iter_unpack(data)]

    def read(cursor: _Cursor) -> list[dict[str, Any]]:
        count = _length(cursor, length)
        cursor.count(count)
        return rows(cursor, min(count, 1)) + rows(cursor, max(count - 1, 0))

    return read


def _length(cursor: _Cursor, fixed: int) -> int:
    return cursor.length() if fixed < 0 else fixed


def _one(field: Field, parts: _Parts) -> _Read:
    if field.type in CODES:
        layouts = _structs([field], parts.serialization)

        def read_number(cursor: _Cursor) -> Any:
            layout = layouts[cursor.phase]
            return layout.unpack_from(cursor.data, cursor.step(layout.size))[0]

        return read_number
    if field.type in STAMPS:
        return _stamp(STAMPS[field.type], parts.serialization)
    if field.type == "string":
        return _text(parts.serialization)
    return _message(field.fields, parts)


def _text(serialization: Serialization) -> _Read:
    end = len(serialization.text_end)

    def read(cursor: _Cursor) -> str:
        data = cursor.slice(cursor.length())
        return str(data[: max(0, len(data) - end)], "utf-8", "replace")

    return read


def _stamp(kind: StampKind, serialization: Serialization) -> _Read:
    layout = struct.Struct("<" + CODES[kind.whole] + CODES[kind.part])
    multiple = serialization.step_of(4)

    def read(cursor: _Cursor) -> dict[str, int]:
        values = layout.unpack_from(cursor.data, cursor.step(8, multiple))
        return dict(zip(kind.names, values, strict=True))

    return read
