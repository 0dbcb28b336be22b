"""Calls of a `RecordSink` in another process, as bytes. Their arguments are checked against the sink's types.

Sentences keep their keys and figures, which the log stores.
"""

from __future__ import annotations

import socket
from multiprocessing.connection import Connection
from typing import Any, get_type_hints

import msgspec
from msgspec import Struct, msgpack

from robots.shared.records.record_sink import RecordSink
from robots.shared.sentences import Sentence, of_parts

SOCKET = "records.sock"  # in the run directory
DONE, NOT_NOW, NEVER = "done", "not_now", "never"  # kinds of answers: result, RecordError, BadRecord
_SENTENCE = 1  # code of the extension type


class Opening(Struct, frozen=True):
    """The first message of a bridge: whose records follow."""

    robot_id: str
    robot_name: str


def _arguments(method: str) -> Any:
    hints = get_type_hints(getattr(RecordSink, method))
    return tuple[tuple(kind for name, kind in hints.items() if name != "return")]  # type: ignore[misc]


_ARGUMENTS = {name: _arguments(name) for name in vars(RecordSink) if not name.startswith("_")}


def framed(connected: socket.socket) -> Connection:
    """Return the connection, with whole messages."""
    connected.setblocking(True)  # rospy sets a time limit for all new sockets of its process
    return Connection(connected.detach())


def encode(value: Any) -> bytes:
    """Return an opening, a call or an answer as bytes."""
    return _encoder.encode(value)


def decode(raw: bytes) -> Any:
    """Return an answer, or the parts of a call."""
    return msgpack.decode(raw, ext_hook=_of_extension)


def opening(raw: bytes) -> Opening:
    """Return a bridge's first message. Raises `msgspec.DecodeError`."""
    return msgpack.decode(raw, type=Opening)


def call_of(raw: bytes) -> tuple[str, tuple[Any, ...]]:
    """Return the name of a method and its arguments. Raises `msgspec.DecodeError` or `KeyError`."""
    name, arguments = decode(raw)
    return name, msgspec.convert(arguments, _ARGUMENTS[name])


def _extended(value: Any) -> Any:
    if isinstance(value, Sentence):
        return msgpack.Ext(_SENTENCE, msgpack.encode([str(value), value.parts]))
    if isinstance(value, float):  # a number of numpy
        return float(value)
    raise NotImplementedError(f"a {type(value).__name__} cannot be recorded")


def _of_extension(_code: int, data: memoryview) -> Sentence:
    return of_parts(*msgpack.decode(data))


_encoder = msgpack.Encoder(enc_hook=_extended)
