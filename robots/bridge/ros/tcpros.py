"""The beginning of a TCPROS conversation, spoken by hand: what a publisher or a service says of itself."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401 isort: skip

import socket
import struct

from robots.bridge.ros.master import Master

LARGEST_HEADER = 1024 * 1024  # bytes of a connection header; a definition is part of it
CONNECT_S = 1.0

Header = dict[str, str]


def connect(host: str, port: int, fields: Header, timeout_s: float = CONNECT_S) -> socket.socket:
    """Connect and say who we are and what we want; `read_header` hears the answer."""
    connection = socket.create_connection((host, port), timeout_s)
    pairs = [f"{key}={value}".encode() for key, value in fields.items()]
    header = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    connection.sendall(struct.pack("<I", len(header)) + header)
    return connection


def connect_to_publisher(
    topic: str, node_uri: str, caller: str, timeout_s: float = CONNECT_S
) -> socket.socket:
    """A subscriber's connection to one publisher, whatever its type."""
    protocol = Master(node_uri, caller, timeout_s).call("requestTopic", topic, [["TCPROS"]])
    if not protocol:
        raise ValueError("does not offer TCPROS")
    _, host, port = protocol
    wanted = {"callerid": caller, "topic": topic, "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
    return connect(host, port, wanted, timeout_s)


def read_header(connection: socket.socket) -> Header:
    """What the other side says of itself."""
    length = read_length(connection)
    if length > LARGEST_HEADER:
        raise ValueError("does not speak TCPROS")
    block, fields, at = read(connection, length), Header(), 0
    while at < length:
        if at + 4 > length:
            raise ValueError("does not speak TCPROS")
        (size,) = struct.unpack_from("<I", block, at)
        key, _, value = block[at + 4 : at + 4 + size].decode(errors="replace").partition("=")
        fields[key] = value
        at += 4 + size
    return fields


def read_length(connection: socket.socket) -> int:
    """A length, as it stands before everything."""
    length: int = struct.unpack("<I", read(connection, 4))[0]
    return length


def read(connection: socket.socket, length: int) -> bytes:
    """Exactly so many bytes."""
    parts = bytearray()
    while len(parts) < length:
        part = connection.recv(min(length - len(parts), 1 << 16))
        if not part:
            raise ConnectionError("closed the connection")
        parts += part
    return bytes(parts)
