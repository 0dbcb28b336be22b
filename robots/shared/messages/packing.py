"""Reads and writes a message's bytes by its definition. Pure: generates no classes, runs no foreign code.

Messages are read in part: only the beginning of long arrays and texts is read, and the rest is skipped. So a
map of a million cells costs no more than a short message.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from robots.shared.messages.fields import FLOATS, INTEGERS, NOW, STAMPS
from robots.shared.messages.serialization import ROS1, Serialization
from robots.shared.sentences import say
from robots.shared.wire import Field

HEADER = "std_msgs/Header"
MAX_STEPS = 200_000  # for one message: some tenths of a second
MAX_WRITTEN_BYTES = 4 * 1024 * 1024  # bytes
_LENGTH = struct.Struct("<I")
CODES = {
    "bool": "?",
    "byte": "b",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}

Time = tuple[int, int]  # seconds, nanoseconds


class Broken(ValueError):
    """The bytes are not a message of this definition."""


class TooLarge(ValueError):
    """A message that takes too long to read, or has too many bytes to write."""


class Detail(NamedTuple):
    """The amount to read: `first` elements of arrays longer than `whole`, and `text` characters of texts."""

    whole: int
    first: int
    text: int


class Reading:
    """A position in one message's bytes; `shortened` has the full length of each array that was read in part."""

    def __init__(self, data: bytes, detail: Detail, serialization: Serialization) -> None:
        self.data = data
        self.at = self._begin = len(serialization.head)
        self._step_of_length = serialization.step_of(4)
        self.detail = detail
        self.shortened: dict[str, int] = {}  # by path
        self._steps_left = MAX_STEPS

    def step(self, size: int, multiple: int = 1) -> int:
        """Advance by `size` bytes, which begin at a multiple of this; return where they begin."""
        self._steps_left -= 1
        if self._steps_left < 0:
            raise TooLarge(say("The message has too many parts to be shown."))
        begin = self.at + (self._begin - self.at) % multiple
        self.at = begin + size
        if self.at > len(self.data):
            raise Broken(say("The message ends after {count} bytes, within a field.", count=len(self.data)))
        return begin

    def length(self) -> int:
        """Read the length prefix."""
        size: int = _LENGTH.unpack_from(self.data, self.step(4, self._step_of_length))[0]
        return size


class Writing:
    """The bytes of one message, as far as they are written."""

    def __init__(self, serialization: Serialization, now: Time) -> None:
        self._serialization = serialization
        self.now = now
        self.out = bytearray(serialization.head)

    def add(self, data: bytes, multiple: int = 1) -> None:
        """Add bytes, which begin at a multiple of this."""
        self.out += bytes(self._serialization.gap(len(self.out), multiple))
        self.out += data

    def length(self, count: int) -> None:
        """Add a length prefix."""
        self.add(_LENGTH.pack(count), self._serialization.step_of(4))


class _Kind(Protocol):
    """A field's type. `size` in bytes; None: it varies. Its bytes begin at a `multiple` of bytes."""

    size: int | None
    multiple: int

    def read(self, reading: Reading, path: str) -> Any: ...

    def skip(self, reading: Reading) -> None: ...

    def write(self, value: Any, writing: Writing) -> None: ...  # None: no value was given


class _Number:
    def __init__(self, type_name: str, serialization: Serialization) -> None:
        self._struct = struct.Struct("<" + CODES[type_name])
        self.size: int | None = self._struct.size
        self.multiple = serialization.step_of(self._struct.size)
        self._blank = False if type_name == "bool" else 0
        self._name = type_name

    def read(self, reading: Reading, path: str) -> Any:
        begin = reading.step(self._struct.size, self.multiple)
        return self.plain(self._struct.unpack_from(reading.data, begin)[0])

    def skip(self, reading: Reading) -> None:
        reading.step(self._struct.size, self.multiple)

    def write(self, value: Any, writing: Writing) -> None:
        writing.add(self._struct.pack(self._blank if value is None else value), self.multiple)

    def plain(self, value: Any) -> Any:
        """Convert for JSON: round a float32 to its digits, NaN and infinities as text."""
        if self._name not in FLOATS:
            return value
        if not math.isfinite(value):
            return "NaN" if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
        return float(f"{value:.7g}") if self._name == "float32" else value


class _Stamp:
    size: int | None = 8

    def __init__(self, type_name: str, serialization: Serialization, blank: Any = None) -> None:
        self._kind = STAMPS[type_name]
        self._struct = struct.Struct("<" + CODES[self._kind.whole] + CODES[self._kind.part])
        self.multiple = serialization.step_of(4)
        self._blank = blank

    def read(self, reading: Reading, path: str) -> dict[str, int]:
        values = self._struct.unpack_from(reading.data, reading.step(8, self.multiple))
        return dict(zip(self._kind.names, values, strict=True))

    def skip(self, reading: Reading) -> None:
        reading.step(8, self.multiple)

    def write(self, value: Any, writing: Writing) -> None:
        value = self._blank if value is None else value
        names = self._kind.names
        parts = writing.now if value == NOW else [value[name] for name in names] if value else (0, 0)
        writing.add(self._struct.pack(*parts), self.multiple)


class _Text:
    size: int | None = None

    def __init__(self, serialization: Serialization) -> None:
        self.multiple = serialization.step_of(4)
        self._end = serialization.text_end

    def read(self, reading: Reading, path: str) -> str:
        size = reading.length()
        begin = reading.step(size)
        size = max(0, size - len(self._end))  # some write an empty text without its end
        kept = reading.detail.text
        text = reading.data[begin : begin + min(size, 4 * kept)].decode(errors="replace")
        return text if len(text) <= kept and size <= 4 * kept else f"{text[:kept]}…"

    def skip(self, reading: Reading) -> None:
        reading.step(reading.length())

    def write(self, value: Any, writing: Writing) -> None:
        text = (value or "").encode() + self._end
        writing.length(len(text))
        writing.add(text)


class _Array:
    def __init__(self, element: _Kind, length: int) -> None:
        self._element = element
        self._length = length  # -1: any length
        self.size = None if length < 0 or element.size is None else length * element.size
        self.multiple = element.multiple

    def read(self, reading: Reading, path: str) -> list[Any]:
        length = reading.length() if self._length < 0 else self._length
        self._check_room(reading, length)
        shown = length
        if length > (reading.detail.whole if self._element.size != 0 else 1):
            shown = reading.detail.first if self._element.size != 0 else 1
            reading.shortened[path] = length
        values = [self._element.read(reading, f"{path}[{number}]") for number in range(shown)]
        self._skip(reading, length - shown)
        return values

    def skip(self, reading: Reading) -> None:
        length = reading.length() if self._length < 0 else self._length
        self._check_room(reading, length)
        self._skip(reading, length)

    def write(self, value: Any, writing: Writing) -> None:
        values = [None] * max(self._length, 0) if value is None else value
        if self._length < 0:
            writing.length(len(values))
        if self._element.size == 0:
            return
        for element in values:
            self._element.write(element, writing)
            if len(writing.out) > MAX_WRITTEN_BYTES:
                raise TooLarge(say("The message would have more than {most} bytes.", most=MAX_WRITTEN_BYTES))

    def _skip(self, reading: Reading, count: int) -> None:
        if self._element.size is not None:
            if count:  # no gap before nothing
                reading.step(count * self._element.size, self._element.multiple)
            return
        for _ in range(count):
            self._element.skip(reading)

    def _check_room(self, reading: Reading, length: int) -> None:
        """Check the length against the bytes left.

        Elements of zero bytes may have any number; they are not iterated.
        """
        if self._element.size != 0 and length > len(reading.data) - reading.at:
            raise Broken(say("An array claims {count} elements, but the message is shorter.", count=length))


class _Message:
    def __init__(self, fields: Sequence[Field], serialization: Serialization, header: bool) -> None:
        self._fields = [(field.name, _kind(field, serialization, header)) for field in fields]
        self._nothing = 0 if fields else serialization.nothing
        kinds = [kind for _, kind in self._fields]
        multiples = {kind.multiple for kind in kinds} or {1}
        # With numbers of different widths, the gaps between them depend on the place where the message begins.
        varies = len(multiples) > 1 or any(kind.size is None for kind in kinds)
        self.size = None if varies else self._nothing + sum(kind.size or 0 for kind in kinds)
        self.multiple = multiples.pop() if not varies else 1

    def read(self, reading: Reading, path: str) -> dict[str, Any]:
        reading.step(self._nothing)  # a message without fields counts as a step, too
        before = f"{path}." if path else ""
        return {name: kind.read(reading, before + name) for name, kind in self._fields}

    def skip(self, reading: Reading) -> None:
        if self.size is not None:
            reading.step(self.size, self.multiple)
            return
        for _, kind in self._fields:
            kind.skip(reading)

    def write(self, value: Any, writing: Writing) -> None:
        writing.add(bytes(self._nothing))
        given = value or {}
        for name, kind in self._fields:
            kind.write(given.get(name), writing)


def _kind(field: Field, serialization: Serialization, header: bool) -> _Kind:
    element: _Kind
    if field.type in STAMPS:
        element = _Stamp(field.type, serialization, NOW if header and field.name == "stamp" else None)
    elif field.type in INTEGERS or field.type in FLOATS:
        element = _Number(field.type, serialization)
    elif field.type == "string":
        element = _Text(serialization)
    else:
        element = _Message(field.fields, serialization, header=field.type == HEADER)
    return element if field.array is None else _Array(element, field.array)


def check_head(data: bytes, serialization: Serialization) -> None:
    """Check the bytes before the first field, without the options in the last two of them. Raises `Broken`."""
    if not data.startswith(serialization.head[:2]) or len(data) < len(serialization.head):
        raise Broken(say("The message begins as no message that the console reads."))


def check_end(at: int, size: int, serialization: Serialization) -> None:
    """Check that a message of `size` bytes ends where its fields end. Raises `Broken`."""
    if at > size or (serialization.exact and at != size):
        raise Broken(
            say("The message has {count} bytes; its definition says {wanted}.", count=size, wanted=at)
        )


class Layout:
    """Byte layout of messages of one definition."""

    def __init__(self, definition: Sequence[Field], serialization: Serialization = ROS1) -> None:
        self._serialization = serialization
        self._message = _Message(definition, serialization, header=False)

    def read(self, data: bytes, detail: Detail) -> tuple[dict[str, Any], dict[str, int]]:
        """Return the fields, and by path the full lengths of shortened arrays. Raises `Broken` or `TooLarge`."""
        check_head(data, self._serialization)
        reading = Reading(data, detail, self._serialization)
        fields = self._message.read(reading, "")
        check_end(reading.at, len(data), self._serialization)
        return fields, reading.shortened

    def write(self, values: dict[str, Any], now: Time) -> bytes:
        """Return the bytes of `fields.fit_fields`'s result; missing values are zero or empty, a header's stamp is now.

        Raises `TooLarge`.
        """
        writing = Writing(self._serialization, now)
        self._message.write(values, writing)
        return bytes(writing.out)
