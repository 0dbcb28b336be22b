"""Reads whole messages by their definition, for programs. Pure.

`packing` reads a part of a message, for people. Arrays of numbers are read at once, so that a picture or a map costs
little more than its bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from robots.shared.messages.fields import FLOATS, INTEGERS, STAMPS
from robots.shared.messages.packing import CODES, MAX_STEPS, Broken, TooLarge
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

    def __init__(self, data: bytes) -> None:
        self.data = memoryview(data)
        self.at = 0
        self._steps_left = MAX_STEPS

    def step(self, size: int) -> int:
        """Advance by `size` bytes; return where they begin."""
        begin = self.at
        self.at += size
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
        size: int = _LENGTH.unpack_from(self.data, self.step(4))[0]
        return size

    def slice(self, size: int) -> memoryview:
        """Read `size` bytes."""
        begin = self.step(size)
        return self.data[begin : begin + size]


_Read = Callable[[_Cursor], Any]


def json_encoder(definition: Sequence[Field]) -> Encode:
    """Return the encoder to JSON, as rosbridge does: NaN and infinities are null, bytes are base64.

    Only float32 have fewer digits.

    Raises `Broken` or `TooLarge`, as all encoders here.
    """
    read = _reader(definition, _plain_numbers)
    encode = msgspec.json.Encoder().encode
    return lambda data: encode(read(data))


def cbor_encoder(definition: Sequence[Field]) -> Encode:
    """Return the encoder to CBOR, as rosbridge does: arrays of numbers are typed arrays."""
    import cbor2  # here, because a bridge encodes none

    read = _reader(definition, _tagged_numbers)
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


def _reader(definition: Sequence[Field], numbers: Numbers) -> Callable[[bytes], dict[str, Any]]:
    read_fields = _message(definition, numbers)

    def read(data: bytes) -> dict[str, Any]:
        cursor = _Cursor(data)
        fields: dict[str, Any] = read_fields(cursor)
        if cursor.at != len(data):
            raise Broken(
                say(
                    "The message has {count} bytes; its definition says {wanted}.",
                    count=len(data),
                    wanted=cursor.at,
                )
            )
        return fields

    return read


def _message(fields: Sequence[Field], numbers: Numbers) -> _Read:
    if fields and all(_is_number(field) for field in fields):
        names, layout = [field.name for field in fields], _struct(fields)
        return lambda cursor: dict(
            zip(names, layout.unpack_from(cursor.data, cursor.step(layout.size)), strict=True)
        )
    parts = [(field.name, _field(field, numbers)) for field in fields]

    def read(cursor: _Cursor) -> dict[str, Any]:
        cursor.count()
        return {name: part(cursor) for name, part in parts}

    return read


def _is_number(field: Field) -> bool:
    return field.array is None and field.type in CODES


def _struct(fields: Sequence[Field]) -> struct.Struct:
    return struct.Struct("<" + "".join(CODES[field.type] for field in fields))


def _field(field: Field, numbers: Numbers) -> _Read:
    if field.array is None:
        return _one(field, numbers)
    length = field.array
    if field.type in INTEGERS or field.type in FLOATS:
        kind, width = field.type, struct.calcsize("<" + CODES[field.type])
        return lambda cursor: numbers(kind, cursor.slice(_length(cursor, length) * width))
    if field.fields and all(_is_number(inner) for inner in field.fields):
        return _rows(field.fields, length)
    one = _one(field, numbers)

    def read(cursor: _Cursor) -> list[Any]:
        count = _length(cursor, length)
        cursor.count(count)
        return [one(cursor) for _ in range(count)]

    return read


def _rows(fields: Sequence[Field], length: int) -> _Read:
    """Return the reader of an array of messages that are only numbers, such as points."""
    names, layout = [field.name for field in fields], _struct(fields)

    def read(cursor: _Cursor) -> list[dict[str, Any]]:
        count = _length(cursor, length)
        cursor.count(count)
        return [
            dict(zip(names, row, strict=True))
            for row in layout.iter_unpack(cursor.slice(count * layout.size))
        ]

    return read


def _length(cursor: _Cursor, fixed: int) -> int:
    return cursor.length() if fixed < 0 else fixed


def _one(field: Field, numbers: Numbers) -> _Read:
    if field.type in CODES:
        layout = _struct([field])
        return lambda cursor: layout.unpack_from(cursor.data, cursor.step(layout.size))[0]
    if field.type in STAMPS:
        return _stamp(struct.Struct("<II" if field.type == "time" else "<ii"))
    if field.type == "string":
        return lambda cursor: str(cursor.slice(cursor.length()), "utf-8", "replace")
    return _message(field.fields, numbers)


def _stamp(layout: struct.Struct) -> _Read:
    def read(cursor: _Cursor) -> dict[str, int]:
        secs, nsecs = layout.unpack_from(cursor.data, cursor.step(8))
        return {"secs": secs, "nsecs": nsecs}

    return read
