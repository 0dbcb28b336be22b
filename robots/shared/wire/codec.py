"""Encode messages as JSON, and decode them. Each message is one JSON object; its `t` names its kind."""

from __future__ import annotations

from itertools import islice
from typing import Any, Generic, TypeVar

import msgspec
from msgspec import UNSET, Struct, structs

from robots.shared.misfits import misfit_of
from robots.shared.sentences import Sentence, say
from robots.shared.wire.base import LARGEST_MESSAGE_BYTES, Refusal, Seq, ShortText, WireError, Worded

T = TypeVar("T")


def _plain(value: Any) -> str:
    """Return the English text of a sentence in a field for a plain text."""
    if isinstance(value, Sentence):
        return str(value)
    raise NotImplementedError(f"a {type(value).__name__} cannot be sent")


# Others know no subclass of `str`: a sentence must not keep a stop from its file, nor an answer from a program
_encoder = msgspec.json.Encoder(enc_hook=_plain)


class MessageDecoder(Generic[T]):
    """Decode and validate a message in one step; raise `WireError`. `messages` is the union of allowed types."""

    def __init__(self, messages: Any, largest_bytes: int = LARGEST_MESSAGE_BYTES) -> None:
        self._decoder = msgspec.json.Decoder(messages)
        self._largest_bytes = largest_bytes

    def __call__(self, raw: str | bytes) -> T:
        if len(raw) > self._largest_bytes:
            raise WireError(
                Refusal(
                    "too_large",
                    say(
                        "The message has {bytes} bytes; at most {most} are taken.",
                        bytes=len(raw),
                        most=self._largest_bytes,
                    ),
                    "wire",
                    {"bytes": len(raw), "limit_bytes": self._largest_bytes},
                )
            )
        try:
            message: T = self._decoder.decode(raw)
        except msgspec.ValidationError as error:
            raise WireError(
                Refusal("invalid", say("The message does not fit: {error}", error=misfit_of(error)), "wire")
            ) from error
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise WireError(
                Refusal("not_json", say("Not a JSON message: {error}", error=misfit_of(error)), "wire")
            ) from error
        return message


class _Heading(Struct):
    t: ShortText = ""
    seq: Seq | None = None


_heading = msgspec.json.Decoder(_Heading)


def heading(raw: str | bytes) -> tuple[str, int | None]:
    """Return kind and number of an invalid message for its refusal; ("", None) if they are unreadable."""
    try:
        found = _heading.decode(raw[:LARGEST_MESSAGE_BYTES])
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return "", None
    return found.t, found.seq


def kind_of(message: Struct) -> str:
    """Return the `t` of a message."""
    return str(type(message).__struct_config__.tag)


def encode(message: Any) -> bytes:
    """Return the message as JSON, sentences as English texts."""
    return _encoder.encode(message)


def framed(header: Struct, content: bytes | memoryview) -> bytes:
    """Return one binary frame: the length of its header, the header as JSON, the content."""
    encoded = _encoder.encode(header)
    return b"".join((len(encoded).to_bytes(_LENGTH_BYTES, "big"), encoded, content))


def unframed(frame: bytes) -> tuple[bytes, memoryview]:
    """Return encoded header and content of a frame."""
    begin = _LENGTH_BYTES + int.from_bytes(frame[:_LENGTH_BYTES], "big")
    return frame[_LENGTH_BYTES:begin], memoryview(frame)[begin:]


def to_builtins(value: Any) -> Any:
    """Return a value as dictionaries, lists, texts and numbers, sentences as English texts."""
    return msgspec.to_builtins(value, enc_hook=_plain)


_LENGTH_BYTES = 4  # of a frame's header
# The largest report of a bridge; the link itself allows eight times as much
LARGEST_REPORT_BYTES = 1024 * 1024
# (longest text, most entries of a list): the first pair by which the report fits
_CUTS = ((2000, 1000), (500, 200), (100, 50), (30, 10))


def encode_report(message: Struct) -> bytes:
    """Encode a bridge's report in at most `LARGEST_REPORT_BYTES`: no text of a robot breaks the link.

    Long texts and lists of a larger report are cut; a cut text ends with its full length, a cut list of texts with
    the number of missing entries. Answers and messages of topics that were encoded elsewhere are not cut.
    """
    encoded = _encoder.encode(message)
    for longest, most in _CUTS:
        if len(encoded) <= LARGEST_REPORT_BYTES:
            break
        encoded = _encoder.encode(_cut(message, longest, most))
    return encoded


def _cut(value: Any, longest: int, most: int) -> Any:
    """Return `value` with texts and lists cut at every level. The length of a tuple is part of its type: not cut."""
    match value:
        case str() if len(value) > longest:
            return f"{value[: longest - 20]}… ({len(value)} long)"
        case Struct():
            fields = value.__struct_fields__
            cut = {name: _cut(getattr(value, name), longest, most) for name in fields}
            if isinstance(value, Worded):  # a cut key is none, and the figures are of the whole text
                cut["said"] = UNSET
            return structs.replace(value, **cut)
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
