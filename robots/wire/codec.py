"""JSON to messages and back. Each message is one JSON object whose `t` names its kind."""

from __future__ import annotations

from itertools import islice
from typing import Any, Generic, TypeVar

import msgspec
from msgspec import Struct, structs

from robots.wire.base import LARGEST_MESSAGE_BYTES, Refusal, Seq, ShortText, WireError

T = TypeVar("T")
_encoder = msgspec.json.Encoder()


class MessageDecoder(Generic[T]):
    """Decodes and validates a message in one step; raises `WireError`. `messages` is the union of allowed types."""

    def __init__(self, messages: Any) -> None:
        self._decoder = msgspec.json.Decoder(messages)

    def __call__(self, raw: str | bytes) -> T:
        if len(raw) > LARGEST_MESSAGE_BYTES:
            raise WireError(
                Refusal(
                    "too_large",
                    f"The message has {len(raw)} bytes; at most {LARGEST_MESSAGE_BYTES} are taken.",
                    "wire",
                    {"bytes": len(raw), "limit_bytes": LARGEST_MESSAGE_BYTES},
                )
            )
        try:
            message: T = self._decoder.decode(raw)
        except msgspec.ValidationError as error:
            raise WireError(Refusal("invalid", f"The message does not fit: {error}", "wire")) from error
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise WireError(Refusal("not_json", f"Not a JSON message: {error}", "wire")) from error
        return message


class _Heading(Struct):
    t: ShortText = ""
    seq: Seq | None = None


_heading = msgspec.json.Decoder(_Heading)


def heading(raw: str | bytes) -> tuple[str, int | None]:
    """Kind and number of a message that does not fit, as far as it has them: its answer carries them."""
    try:
        found = _heading.decode(raw[:LARGEST_MESSAGE_BYTES])
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return "", None
    return found.t, found.seq


def kind_of(message: Struct) -> str:
    """Its `t`."""
    return str(type(message).__struct_config__.tag)


def encode(message: Struct) -> bytes:
    """The message as JSON."""
    return _encoder.encode(message)


LARGEST_REPORT_BYTES = (
    1024 * 1024
)  # of what a bridge says of its robot; the link itself takes eight times as much
_CUTS = (
    (2000, 1000),
    (500, 200),
    (100, 50),
    (30, 10),
)  # longest text, most entries of a list: the first that fits


def encode_report(message: Struct) -> bytes:
    """Encode a bridge's report, at most `LARGEST_REPORT_BYTES`: no text of a robot breaks the link.

    Texts and lists of a larger one are cut, and say how much is missing; answers and messages of topics that were
    encoded elsewhere stay whole.
    """
    encoded = _encoder.encode(message)
    for longest, most in _CUTS:
        if len(encoded) <= LARGEST_REPORT_BYTES:
            break
        encoded = _encoder.encode(_cut(message, longest, most))
    return encoded


def _cut(value: Any, longest: int, most: int) -> Any:
    """`value` with texts and lists cut, at every level; tuples have a length that is part of their type."""
    match value:
        case str() if len(value) > longest:
            return f"{value[: longest - 20]}… ({len(value)} long)"
        case Struct():
            fields = value.__struct_fields__
            return structs.replace(
                value, **{name: _cut(getattr(value, name), longest, most) for name in fields}
            )
        case tuple():
            return tuple(_cut(part, longest, most) for part in value)
        case list():
            kept = [_cut(part, longest, most) for part in value[:most]]
            if len(value) > most and isinstance(value[0], str):
                kept[-1] = f"and {len(value) - most + 1} more"
            return kept
        case dict():
            pairs = islice(value.items(), most)
            return {_cut(key, longest, most): _cut(part, longest, most) for key, part in pairs}
    return value
