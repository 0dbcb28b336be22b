"""The header exchange of a TCPROS connection, in which a publisher or service describes itself."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import TypeVar

import msgspec

from robots.shared.ros.master import Master, MasterError, left_s
from robots.shared.sentences import reason_of, say

LARGEST_HEADER = 1024 * 1024  # bytes of a connection header, which includes a definition
MOST_FIELDS = 100  # of a header
CONNECT_S = 1.0

Header = dict[str, str]
T = TypeVar("T")


class Conversation:
    """One connection with a time limit: after `until_s` each read or write raises TimeoutError."""

    def __init__(self, connection: socket.socket, until_s: float) -> None:
        self.until_s = until_s  # by the monotonic clock
        self._connection = connection

    def __enter__(self) -> Conversation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()

    def send(self, message: bytes) -> None:
        """Send a message with its length prefix."""
        self._connection.settimeout(left_s(self.until_s))
        self._connection.sendall(struct.pack("<I", len(message)) + message)

    def read(self, length: int) -> bytes:
        """Read exactly `length` bytes."""
        parts = bytearray()
        while len(parts) < length:
            self._connection.settimeout(left_s(self.until_s))
            part = self._connection.recv(min(length - len(parts), 1 << 16))
            if not part:
                raise ConnectionError(say("closed the connection"))
            parts += part
        return bytes(parts)

    def read_length(self) -> int:
        """Read a length prefix."""
        length: int = struct.unpack("<I", self.read(4))[0]
        return length

    def read_header(self, largest: int = LARGEST_HEADER) -> Header:
        """Read the other side's header of at most `largest` bytes. Raises ValueError if it is no header."""
        length = self.read_length()
        if length > largest:
            raise ValueError(say("does not speak TCPROS"))
        block, fields, at = self.read(length), Header(), 0
        while at < length:
            if at + 4 > length or len(fields) >= MOST_FIELDS:
                raise ValueError(say("does not speak TCPROS"))
            (size,) = struct.unpack_from("<I", block, at)
            key, _, value = block[at + 4 : at + 4 + size].decode(errors="replace").partition("=")
            fields[key] = value
            at += 4 + size
        return fields


def connect(host: str, port: int, fields: Header, timeout_s: float = CONNECT_S) -> Conversation:
    """Connect and send our header; `read_header` reads the answer. The whole exchange ends within `timeout_s`."""
    until_s = time.monotonic() + timeout_s
    pairs = [f"{key}={value}".encode() for key, value in fields.items()]
    connection = socket.create_connection((host, port), timeout_s)
    conversation = Conversation(connection, until_s)
    try:
        conversation.send(b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs))
    except OSError:
        connection.close()
        raise
    return conversation


def connect_to_publisher(
    topic: str, node_uri: str, caller: str, timeout_s: float = CONNECT_S
) -> Conversation:
    """Connect to one publisher of any type, as a subscriber."""
    protocol = Master(node_uri, caller, timeout_s).call("requestTopic", topic, [["TCPROS"]])
    try:
        _, host, port = msgspec.convert(protocol, tuple[str, str, int])
    except msgspec.ValidationError as error:
        raise ValueError(say("does not offer TCPROS")) from error
    wanted = {"callerid": caller, "topic": topic, "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
    return connect(host, port, wanted, timeout_s)


def first_response(
    read: Callable[[Conversation], T],
    topic: str,
    publishers: Mapping[str, str | None],  # address by node; None if the master has none
    caller: str,
    timeout_s: float = CONNECT_S,
) -> tuple[T | None, dict[str, str]]:
    """Return the result of `read` for the first reachable publisher, and the errors of the others by node."""
    unheard: dict[str, str] = {}
    for node, uri in publishers.items():
        try:
            if uri is None:
                raise ValueError(say("has no address at the master"))
            with connect_to_publisher(topic, uri, caller, timeout_s) as conversation:
                return read(conversation), unheard
        except (OSError, MasterError, ValueError, struct.error) as error:
            unheard[node] = reason_of(error)
    return None, unheard
