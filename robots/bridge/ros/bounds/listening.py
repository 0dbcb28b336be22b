"""Limits rospy's reading from publishers: connections, sizes, messages a second, processor time.

A publisher that sends more than its topic's `Kind` allows is cut off before its message is deserialized,
shown on the `BOARD`, and connected again after `DROPPED_S`. Until then its data is missing, so the gate
applies its rules for silent sources.
"""

from __future__ import annotations

import io
import logging
import math
import os
import select
import struct
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import genpy
import msgspec
import rosgraph
import rospy
from rospy.exceptions import TransportException, TransportInitError, TransportTerminated
from rospy.impl.registration import RegManager, get_topic_manager
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol
from rospy.impl.tcpros_pubsub import TCPROSSub
from rospy.impl.transport import INBOUND

from robots.bridge.robot.board import BOARD
from robots.bridge.robot.incoming.standing import NEWEST_WITHIN_S
from robots.bridge.ros.bounds.servers import CALL_REFUSED
from robots.bridge.ros.bounds.sizes import Kind, kind_of
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.ros.master import Master, MasterError
from robots.shared.sentences import say
from robots.shared.texts import NAME, cut, size_text

log = logging.getLogger(__name__)

DROPPED_S = 10.0  # until a publisher that was cut off is connected again
# Wait before the next try to reach a publisher: at first 2 s, doubled after each failure, at most 30 s.
AGAIN_S = (2.0, 30.0)
CONNECT_S = 5.0
MOST_DIALLING = 32  # connections in progress, of all topics
KEPT_BYTES = 2 << 20  # of a connection's buffer: a depth picture of 640 x 480 has 0.6 or 1.2 MB
CHECK_S = 1.0  # between two checks whether a barred publisher may be tried again

_length = struct.Struct("<I")
_here = threading.local()


class _Pause(NamedTuple):
    seconds: Callable[[], float]
    hurried_s: float | None
    newest_only: bool


_pauses: dict[str, _Pause] = {}  # by topic
_hurry = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)  # readable while pauses must end
_hurries = False


def pause(
    topic: str, seconds: Callable[[], float], *, hurried_s: float | None = None, newest_only: bool = False
) -> None:
    """Read a topic's publishers seldom: waking for every message costs three times the processor time.

    Messages that arrive during the pause wait in the socket, and one read takes them all; rospy keeps the
    newest `queue_size` of them, or the newest one only if that hides no silence. `seconds` is called before each
    read but the first, on rospy's thread. With `hurried_s`, a hurry ends the pause at once, and during it all
    messages are read, with pauses of so many seconds.
    """
    _pauses[topic] = _Pause(seconds, hurried_s, newest_only)


def hurry(wanted: bool) -> None:
    """End pauses at once, and make shorter ones until a hurry is no longer wanted."""
    global _hurries
    if wanted != _hurries:
        _hurries = wanted
        (os.eventfd_write(_hurry, 1) if wanted else os.eventfd_read(_hurry))


class Reading:
    """Counts a publisher's messages and processor time. Pure: time is an argument."""

    def __init__(self, kind: Kind) -> None:
        self._kind = kind
        # The burst is twice the rate: after the network stalled, many messages arrive together.
        self._messages = TokenBucket(kind.most_hz, 2.0 * kind.most_hz)
        self._time = TokenBucket(kind.share, 2.0 * kind.share)

    def why_not(self, largest: int, messages: int, worked_s: float, now_s: float) -> str:
        """Return why the publisher is cut off, or "".

        `largest`: size of the largest message (bytes). `messages`: their number. `worked_s`: processor time.
        """
        if largest > self._kind.most_bytes:
            return say(
                "sends messages of {size}, at most {most} is taken",
                size=size_text(largest),
                most=size_text(self._kind.most_bytes),
            )
        if not self._messages.spend(now_s, messages):
            return say("sends more than {most:.0f} messages a second", most=self._kind.most_hz)
        if not self._time.spend(now_s, worked_s):
            return say("takes more than {percent:.0f}% of a processor", percent=100.0 * self._kind.share)
        return ""


class Listening(TCPROSTransportProtocol):  # type: ignore[misc]
    """A connection to one publisher, in place of rospy's TCPROSSub. Runs on its own thread."""

    get_header_fields = TCPROSSub.get_header_fields
    queue_size: int | None

    def __init__(
        self, resolved_name: str, recv_data_class: Any, *more: Any, tcp_nodelay: bool = False, **others: Any
    ) -> None:
        super().__init__(resolved_name, recv_data_class, *more, **others)
        self.direction = INBOUND
        self.tcp_nodelay = tcp_nodelay
        self.topic = resolved_name
        self.transport: Any = None
        self._reading = Reading(kind_of(resolved_name, recv_data_class._type))
        self._worked_s: float | None = None
        self._dropped = ""
        self._reads_newest = False
        self._read_s = -math.inf
        self.stands_for = 1  # messages that came together, of which one was read

    def rest(self) -> None:
        """Pause before the next read, on rospy's thread. The pause ends when the publisher disconnects.

        rospy refuses a second connection to a publisher, so the old connection must be gone before the
        publisher comes back.
        """
        pause = _pauses.get(self.topic)
        self._reads_newest = False
        if pause is None or self._worked_s is None:
            return
        hurried_s = pause.hurried_s if _hurries else None
        seconds = pause.seconds() if hurried_s is None else hurried_s
        if seconds <= 0.0:
            return
        ended = select.poll()
        ended.register(self.transport.socket, select.POLLRDHUP)
        if pause.hurried_s is not None and hurried_s is None:
            ended.register(_hurry, select.POLLIN)
        ended.poll(1000.0 * seconds)
        self._reads_newest = pause.newest_only and not _hurries

    def drop(self, why: str) -> None:
        """Cut the publisher off before its next message is read. Thread-safe."""
        self._dropped = why

    def read_messages(self, b: io.BytesIO, msg_queue: list[Any], sock: Any) -> None:
        """Deserialize the received messages. Raises TransportTerminated if they exceed the limits."""
        _here.speaker = self
        (largest, messages), now_s = _came(b), time.monotonic()
        why = self._dropped or self._reading.why_not(largest, messages, self._work_s(), now_s)
        newest_only = self._reads_newest and now_s - self._read_s < NEWEST_WITHIN_S
        self._read_s = now_s
        if not why:
            kept = self.queue_size
            self.queue_size, self.stands_for = (1, messages) if newest_only else (kept, 1)
            try:
                super().read_messages(b, msg_queue, sock)
            except genpy.DeserializationError:
                why = say("sends messages that cannot be read")
            finally:
                self.queue_size = kept
        if why:
            self._cut_off(why)

    def _work_s(self) -> float:
        """Return the processor time (s) of this thread since the last call."""
        before_s, self._worked_s = self._worked_s, time.thread_time()
        return 0.0 if before_s is None else self._worked_s - before_s

    def _cut_off(self, why: str) -> None:
        node = cut(str(self.transport.callerid_pub), NAME)
        BOARD.bar(self.topic, self.transport.endpoint_id, time.monotonic() + DROPPED_S)
        BOARD.complain(
            self.topic,
            say(
                "{topic}: {node} {why}. The console ignores it for {seconds:.0f} s.",
                topic=self.topic,
                node=node,
                why=why,
                seconds=DROPPED_S,
            ),
        )
        raise TransportTerminated(why)


def speaker() -> Listening | None:
    """Return the publisher whose message this rospy thread handles; None on other threads."""
    return getattr(_here, "speaker", None)


def _came(b: io.BytesIO) -> tuple[int, int]:
    """Return the largest message's size (bytes), also if incomplete, and the number of complete messages."""
    largest = messages = at = 0
    end = b.tell()
    with b.getbuffer() as came:
        while at + 4 <= end:
            (size,) = _length.unpack_from(came, at)
            at += 4 + size
            largest = max(largest, size)
            messages += at <= end
    return largest, messages


class _Buffer(io.BytesIO):
    """Keeps its memory when it is emptied: otherwise each picture needs pages anew, half of the cost of its reading.

    rospy uses only what is before the position.
    """

    def truncate(self, size: int | None = None) -> int:
        with self.getbuffer() as kept:
            is_small = kept.nbytes <= KEPT_BYTES
        return (size or 0) if is_small else super().truncate(size)


class Transport(TCPROSTransport):  # type: ignore[misc]
    """A connection with its protocol's limits. It ends the process when memory is exhausted."""

    exhausted: Callable[[], None] = staticmethod(lambda: None)

    def __init__(self, protocol: Any, name: str, header: Any = None) -> None:
        super().__init__(protocol, name, header)
        if isinstance(protocol, Listening):
            protocol.transport = self
            self.read_buff = _Buffer()

    def receive_once(self) -> Any:
        """Read messages, on rospy's thread for this connection."""
        if isinstance(self.protocol, Listening):
            self.protocol.rest()
        try:
            return super().receive_once()
        except MemoryError:
            self.exhausted()
            raise
        except TransportException as error:
            if isinstance(error.__context__, MemoryError):
                self.exhausted()
            raise


# --- connecting ----------------------------------------------------------------------------------

_dialling: set[tuple[str, str]] = set()
_failures: dict[tuple[str, str], float] = {}  # last pause (s)
_ended: set[str] = set()  # topics of which a connection has ended since the last look
_lock = threading.Lock()


def connect(manager: Any, topic: str, uri: str) -> None:
    """Connect to one publisher, or give up, on its own thread. Replaces RegManager._connect_topic_thread."""
    subscriber = get_topic_manager().get_subscriber_impl(topic)
    if subscriber is None or subscriber.has_connection(uri) or BOARD.barred(topic, uri):
        return
    most = kind_of(topic, subscriber.type).publishers
    if len(subscriber.connections) >= most:
        text = say(
            "{topic}: more than {most} nodes publish; the console ignores the others.", topic=topic, most=most
        )
        BOARD.complain(topic, text)
        BOARD.bar(topic, uri, time.monotonic() + DROPPED_S)
        return
    with _lock:
        if (topic, uri) in _dialling or len(_dialling) >= MOST_DIALLING:
            BOARD.bar(topic, uri, time.monotonic() + AGAIN_S[0])
            return
        _dialling.add((topic, uri))
    try:
        protocol = Master(uri, rospy.get_caller_id()).call("requestTopic", topic, [["TCPROS"]])
        _, host, port = msgspec.convert(protocol, tuple[str, str, int])
        manager.handler.protocol_handlers[0].create_transport(topic, uri, ["TCPROS", host, port])
    except (MasterError, msgspec.ValidationError, OSError) as error:
        log.debug("%s cannot be reached for %s: %s", uri, topic, error)
        _later(topic, uri)
    finally:
        with _lock:
            _dialling.discard((topic, uri))


def receive(connection: Any, host: str, port: int, uri: str, take: Any, topic: str) -> None:
    """Connect once, and read; after a failure, try again later. Replaces rospy's robust_connect_subscriber.

    Runs on the connection's thread. After its end, the master is asked for the publishers again: its word of a
    publisher that comes back on the same node may arrive before the end of the old connection, and then counts for it.
    """
    try:
        connection.connect(host, port, uri, timeout=CONNECT_S)
    except TransportInitError as error:
        log.debug("%s cannot be listened to on %s: %s", uri, topic, error)
        _later(topic, uri)
        connection.close()
        return
    with _lock:
        _failures.pop((topic, uri), None)
    connection.receive_loop(take)
    with _lock:
        _ended.add(topic)


def _later(topic: str, uri: str) -> None:
    """Try the publisher again after a pause, which doubles after each failure."""
    with _lock:
        if len(_failures) >= 10 * MOST_DIALLING:
            _failures.clear()
        pause_s = _failures[topic, uri] = min(2.0 * _failures.get((topic, uri), AGAIN_S[0] / 2.0), AGAIN_S[1])
    BOARD.bar(topic, uri, time.monotonic() + pause_s)


class Manager(RegManager):  # type: ignore[misc]
    """rospy's RegManager, with connections made by `connect`."""

    def __init__(self, handler: Any) -> None:
        super().__init__(handler)
        threading.Thread(target=self._try_again, name="publishers", daemon=True).start()

    def _connect_topic_thread(self, topic: str, uri: str) -> None:
        try:
            connect(self, topic, uri)
        except Exception:  # a fault of the publisher; the next update from the master starts another try
            log.exception("a publisher of %s cannot be listened to", topic)

    def publisher_update(self, topic: str, uris: list[Any]) -> None:
        """Take only some of a topic's publishers: a false master could send thousands."""
        subscriber = get_topic_manager().get_subscriber_impl(topic)
        if subscriber is not None:
            most = 2 * kind_of(topic, subscriber.type).publishers
            found = dict.fromkeys(uri for uri in uris if isinstance(uri, str) and len(uri) <= NAME)
            super().publisher_update(topic, list(found)[:most])

    def _try_again(self) -> None:
        """Ask the master again for the publishers of a topic when one has ended, or is no longer barred."""
        while not rospy.is_shutdown():
            time.sleep(CHECK_S)
            topics = BOARD.released(time.monotonic())
            with _lock:
                topics |= _ended
                _ended.clear()
            if CALL_REFUSED.is_set():
                CALL_REFUSED.clear()
                topics |= {topic for topic, _ in get_topic_manager().get_subscriptions()}
                # Any host can cause refused calls: they must not cause calls to the master all the time.
                time.sleep(DROPPED_S / 2.0)
            for topic in topics:
                subscriber = get_topic_manager().get_subscriber_impl(topic)
                if subscriber is None or not self.uri:
                    continue
                try:
                    master = Master(rosgraph.get_master_uri(), rospy.get_caller_id())
                    uris = master.register("registerSubscriber", topic, subscriber.type, self.uri)
                    self.publisher_update(topic, uris)
                except MasterError as error:
                    log.debug("the publishers of %s cannot be asked for: %s", topic, error)
