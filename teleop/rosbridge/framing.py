"""A message of a topic as the client wants it: text, PNG, CBOR; in one piece or in fragments. Pure.

The tap has encoded the message itself (`msg`) once for all clients: here only a head is put before it.
"""

from __future__ import annotations

import math
import struct
import zlib
from base64 import b64encode
from collections.abc import Iterator
from functools import lru_cache

import cbor2
import msgspec

MOST_FRAGMENTS = 1000  # of one message: smaller fragments than it allows are not made
_SHARED_BYTES = 256 * 1024  # the texts of larger messages are not kept for the next client
_PNG = b"\x89PNG\r\n\x1a\n"


def as_text(name: str, body: bytes) -> str:
    """Return a message whose `body` is JSON as an operation."""
    return _shared(name, body) if len(body) <= _SHARED_BYTES else _text(name, body)


def _text(name: str, body: bytes) -> str:
    head = b'{"op":"publish","topic":%s,"msg":' % msgspec.json.encode(name)
    return b"".join((head, body, b"}")).decode(errors="replace")


_shared = lru_cache(maxsize=16)(_text)  # many clients get the same text


def as_cbor(name: str, body: bytes) -> bytes:
    """Return a message whose `body` is CBOR as an operation."""
    return _cbor_head(name) + body


def as_cbor_raw(name: str, body: bytes, stamp_ns: int) -> bytes:
    """Return a message in the robot's own bytes as an operation, with the time of its arrival."""
    secs, nsecs = divmod(stamp_ns, 1_000_000_000)
    time = b"".join(cbor2.dumps(part) for part in ("secs", secs, "nsecs", nsecs, "bytes"))
    # A map of three, and the head of a byte string of this length
    return b"".join((_cbor_head(name), b"\xa3", time, b"\x5b", struct.pack(">Q", len(body)), body))


@lru_cache(maxsize=1000)
def _cbor_head(name: str) -> bytes:
    return b"\xa3" + b"".join(cbor2.dumps(part) for part in ("op", "publish", "topic", name, "msg"))


def as_png(text: str) -> str:
    """Return an operation with the text of another one as a PNG picture, three bytes in a pixel. Takes time."""
    data = text.encode()
    width = max(1, math.isqrt(len(data) // 3))
    height = math.ceil(len(data) / (3 * width))
    data = data.ljust(3 * width * height, b"\n")
    rows = b"".join(b"\0" + data[begin : begin + 3 * width] for begin in range(0, len(data), 3 * width))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = (b"IHDR", header), (b"IDAT", zlib.compress(rows, 1)), (b"IEND", b"")
    picture = _PNG + b"".join(
        struct.pack(">I", len(part)) + kind + part + struct.pack(">I", zlib.crc32(kind + part))
        for kind, part in parts
    )
    return msgspec.json.encode({"op": "png", "data": b64encode(picture).decode()}).decode()


def fragments(text: str, size: int, id_: str) -> Iterator[str]:
    """Yield an operation as fragments of at most `size` characters; as it is if it is not longer."""
    if len(text) <= size:
        yield text
        return
    size = max(size, math.ceil(len(text) / MOST_FRAGMENTS))
    total = math.ceil(len(text) / size)
    for number in range(total):
        data = text[number * size : (number + 1) * size]
        part = {"op": "fragment", "id": id_, "data": data, "num": number, "total": total}
        yield msgspec.json.encode(part).decode()
