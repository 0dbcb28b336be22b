"""Limits rospy's two servers: XML-RPC and topics.

Each connection uses one thread at most, for a limited time; when there are too many, the oldest is closed.
Both servers limit the bytes of a call and of a connection's header.
"""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import rosgraph.network
from rosgraph.xmlrpc import SilenceableXMLRPCRequestHandler, ThreadingXMLRPCServer
from rospy.impl.registration import get_topic_manager

from robots.bridge.robot.board import BOARD
from robots.bridge.ros.network.tcpros import LARGEST_HEADER, Conversation
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.processes.memory import end_without_memory
from robots.shared.sentences import say
from robots.shared.texts import NAME, SENTENCE, cut

log = logging.getLogger(__name__)

LARGEST_CALL = 128 * 1024  # bytes of an XML-RPC call, including its HTTP header
LARGEST_INBOUND = 64 * 1024  # bytes of the header of a node that connects to one of our topics
HEADER_S = 5.0  # until the header must be complete
IDLE_S = 30.0  # until a silent caller is disconnected; it may connect again
MOST_CALLERS = 32  # connections to the XML-RPC server
MOST_HANDSHAKES = 32  # connections whose header is being read
MOST_LISTENERS = 32  # of one topic
PER_S, BURST = 100.0, 300.0  # connections, and calls, of one address
MOST_ADDRESSES = 256


# Set when a call was refused. The call may have been the master's update of publishers, so the master is
# asked again.
CALL_REFUSED = threading.Event()


class CallerLimits:
    """Counts calls and connections of each address. Safe to use from several threads."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._budgets: OrderedDict[str, TokenBucket] = OrderedDict()
        self._open: OrderedDict[socket.socket, None] = OrderedDict()

    def allow(self, address: str, now_s: float) -> bool:
        """Return whether this address may make one more call or connection."""
        with self._lock:
            budget = self._budgets.setdefault(address, TokenBucket(PER_S, BURST))
            self._budgets.move_to_end(address)
            while len(self._budgets) > MOST_ADDRESSES:
                self._budgets.popitem(last=False)
            return budget.spend(now_s)

    def enter(self, connection: socket.socket) -> None:
        """Add a connection. If there are too many now, the oldest is closed."""
        with self._lock:
            self._open[connection] = None
            oldest = next(iter(self._open)) if len(self._open) > self._most else None
            if oldest is not None:
                del self._open[oldest]
        if oldest is not None:
            _hang_up(oldest)

    def leave(self, connection: socket.socket) -> None:
        """Remove a connection that ended."""
        with self._lock:
            self._open.pop(connection, None)


def _hang_up(connection: socket.socket) -> None:
    """Close a connection. The thread that reads from it gets the end of the stream."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError as error:
        log.debug("a connection was over already: %s", error)


# --- XML-RPC ----------------------------------------------------------------------------------------


class _LimitedFile:
    """A file with a byte budget for reading; `left` is set again for each call."""

    def __init__(self, file: Any) -> None:
        self._file = file
        self.left = LARGEST_CALL

    def readline(self, most: int = -1) -> bytes:
        return self._count(self._file.readline(self._at_most(most)))

    def read(self, most: int = -1) -> bytes:
        return self._count(self._file.read(self._at_most(most)))

    def _at_most(self, most: int) -> int:
        return self.left if most < 0 else min(most, self.left)

    def _count(self, data: bytes) -> bytes:
        self.left -= len(data)
        return data

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


class _Handler(SilenceableXMLRPCRequestHandler):  # type: ignore[misc]
    timeout = IDLE_S
    rfile: Any

    def setup(self) -> None:
        super().setup()
        self.rfile = _LimitedFile(self.rfile)

    def handle_one_request(self) -> None:
        self.rfile.left = LARGEST_CALL
        super().handle_one_request()

    def do_POST(self) -> None:
        size = self.headers.get("Content-Length", "")
        if not self.server.callers.allow(self.client_address[0], time.monotonic()):
            self._refuse(503, "too many calls")
        elif not size.isdecimal() or int(size) > LARGEST_CALL or self.headers.get("Content-Encoding"):
            self._refuse(413, "a call must be short, with its length, and not compressed")
        else:
            self.connection.settimeout(HEADER_S)
            super().do_POST()
            self.connection.settimeout(IDLE_S)

    def _refuse(self, code: int, words: str) -> None:
        CALL_REFUSED.set()
        self.close_connection = True
        self.send_error(code, words)

    def log_error(self, *_: Any) -> None:
        """Log nothing: any host can cause such an error."""


class Server(ThreadingXMLRPCServer):  # type: ignore[misc]
    """rospy's XML-RPC server, with limits."""

    def __init__(self, address: tuple[str, int], log_requests: bool = False) -> None:
        self.callers = CallerLimits(MOST_CALLERS)
        super().__init__(address, log_requests)
        self.RequestHandlerClass = _Handler

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Refuse addresses with too many connections; close the oldest connection when there are too many."""
        if not self.callers.allow(client_address[0], time.monotonic()):
            CALL_REFUSED.set()
            return False
        self.callers.enter(request)
        return True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log a broken connection only for debugging: any host can cause one."""
        log.debug("a call from %s broke", client_address[0])

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self.callers.leave(request)
        super().shutdown_request(request)


# --- topics -----------------------------------------------------------------------------------------

_handshakes = CallerLimits(MOST_HANDSHAKES)
_taking = threading.Lock()  # rospy can add only one listener at a time


def take_connection(
    server: Any,
    connection: socket.socket,
    address: tuple[str, int],
    exhausted: Callable[[], None] = end_without_memory,
) -> None:
    """Handle a node's new connection. Returns at once. Replaces TCPROSServer._tcp_server_callback."""
    if not _handshakes.allow(address[0], time.monotonic()):
        connection.close()
        return
    _handshakes.enter(connection)
    try:
        threading.Thread(target=_shake_hands, args=(server, connection, address), daemon=True).start()
    except RuntimeError:  # no memory for a thread
        connection.close()
        exhausted()


def _shake_hands(server: Any, connection: socket.socket, address: tuple[str, int]) -> None:
    conversation = Conversation(connection, time.monotonic() + HEADER_S)
    try:
        header = conversation.read_header(LARGEST_INBOUND)
        connection.setblocking(True)
        with _taking:
            refusal = _why_full(header) or server.topic_connection_handler(connection, address, header)
        if refusal:
            conversation.send(_field("error", cut(refusal, SENTENCE)))
            connection.close()
    except Exception as error:  # noqa: BLE001  (faulty bytes of any host end only their connection)
        log.debug("somebody at %s does not speak TCPROS: %s", address[0], error)
        connection.close()
    finally:
        _handshakes.leave(connection)


def _why_full(header: dict[str, str]) -> str:
    topic = header.get("topic")
    if topic is None:
        return "only topics are here"  # rospy's own services would let any node turn on its debug log
    header["callerid"] = cut(header.get("callerid", "unknown"), NAME)
    publisher = get_topic_manager().get_publisher_impl(topic)
    if publisher is None or len(publisher.connections) < MOST_LISTENERS:
        return ""
    BOARD.complain(
        f"listeners of {topic}",
        say("{topic}: more than {most} nodes listen; others are refused.", topic=topic, most=MOST_LISTENERS),
    )
    return f"more than {MOST_LISTENERS} listen already"


def _field(name: str, value: str) -> bytes:
    pair = f"{name}={value}".encode()
    return len(pair).to_bytes(4, "little") + pair


def read_header(connection: socket.socket, _buffer: Any, _size: int) -> dict[str, str]:
    """Replace rosgraph's read_ros_handshake_header, with limits of bytes and time. Raises ValueError or OSError."""
    return Conversation(connection, time.monotonic() + HEADER_S).read_header(LARGEST_HEADER)


# --- bind address -----------------------------------------------------------------------------------

_rospys_own = rosgraph.network.get_bind_address


def bind_address(address: str | None = None) -> str:
    """Return the advertised address if it belongs to this computer, else rospy's choice."""
    advertised = address or rosgraph.network.get_address_override()
    if advertised:
        try:
            found = socket.gethostbyname(advertised)
            # Debian resolves a computer's own name to 127.0.1.1.
            if found.startswith("127.") and found != advertised:
                return str(_rospys_own(address))
            with socket.socket() as probe:
                probe.bind((found, 0))
            return found
        except OSError as error:
            log.warning("%s is no address of this computer (%s): bound to all", advertised, error)
    return str(_rospys_own(address))
