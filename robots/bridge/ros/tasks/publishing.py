"""Publishes on topics that rospy may close at any moment: another node of the same name causes that."""

from __future__ import annotations

import socket
import struct
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

import rospy
from geometry_msgs.msg import Twist, TwistStamped
from rospy.core import is_shutdown_requested

from robots.shared.graph import is_own

PATIENCE_S = 1.0  # longest wait of a message for a listener; connecting takes some milliseconds
SEND_BUFFER_BYTES = 16 * 1024  # some seconds of twists


def heard_by(publisher: rospy.Publisher) -> list[Any]:
    """Return rospy's connections to listeners. The console's own processes do not count: they do not move."""
    return [connection for connection in publisher.impl.connections if not is_own(connection.endpoint_id)]


def immediate_publisher(topic: str, kind: type[Any], patience_s: float) -> rospy.Publisher:
    """Return a publisher that sends on the calling thread: no message waits in a rospy queue."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # rospy warns of a missing queue size
        return rospy.Publisher(topic, kind, subscriber_listener=_AtOnce(patience_s), queue_size=None)


class _AtOnce(rospy.SubscribeListener):  # type: ignore[misc]
    """Sends messages at once, without a queue and its thread; disconnects a subscriber that does not read.

    rospy's publishers use Nagle's algorithm, because its subscribers request it, but a twist must not wait
    for an ACK. If a listener's buffers are full, the listener has not read for seconds: then the write gives
    up, and rospy closes the connection. The listener connects again when it works again. One message waits at
    most `patience_s` for all listeners together.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        connections = topic_publish.__self__.connections
        microseconds = max(round(self._patience_s * 1e6 / max(len(connections), 1)), 1000)
        patience = struct.pack("@ll", *divmod(microseconds, 1_000_000))  # a timeval
        for connection in connections:
            connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, patience)


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publish a message. Ignore closed topics while rospy shuts down: `RosBase` handles the end."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not is_shutdown_requested():
            raise


def stamped(twist: Twist, clocks_agree: bool) -> TwistStamped:
    """Return a message with the time of this computer; if the robot's clock differs, with zero, which means now."""
    message = TwistStamped(twist=twist)
    if clocks_agree:
        message.header.stamp = rospy.Time.from_sec(time.time())
    return message


class Sender(rospy.SubscribeListener):  # type: ignore[misc]
    """A topic whose newest message waits up to `PATIENCE_S` for a listener, if there is none yet.

    `joined` is called on a rospy thread whenever a node of the robot begins to listen.
    """

    def __init__(self, topic: str, kind: type[Any], joined: Callable[[], None] = lambda: None) -> None:
        self._joined = joined
        self._lock = threading.Lock()
        self._waiting: tuple[Any, float] | None = None  # message, and the end of its wait (s)
        self._heard_by: list[Any] = []  # the listeners at the last connection
        with self._lock:  # a listener may connect before `self.publisher` is set
            self.publisher = rospy.Publisher(topic, kind, subscriber_listener=self, queue_size=5)

    def send(self, message: Any) -> None:
        """Publish to present listeners, else to those that connect within `PATIENCE_S`."""
        with self._lock:
            heard = bool(heard_by(self.publisher))
            self._waiting = None if heard else (message, time.monotonic() + PATIENCE_S)
        if heard:
            publish(self.publisher, message)

    def withdraw(self) -> None:
        """Drop messages that are not sent yet."""
        with self._lock:
            self._waiting = None

    def close(self) -> None:
        """Unregister the topic."""
        self.withdraw()
        self.publisher.unregister()

    # --- on rospy's threads ------------------------------------------------------------------------

    def peer_subscribe(self, _topic: str, _all: Callable[[Any], None], peer: Callable[[Any], None]) -> None:
        """Handle a new listener. rospy guards each publication with this lock, except the one to a single peer."""
        with self._lock:
            if self._waiting is not None and time.monotonic() < self._waiting[1]:
                self.publisher.impl.acquire()
                try:
                    peer(self._waiting[0])
                finally:
                    self.publisher.impl.release()
            before, self._heard_by = self._heard_by, heard_by(self.publisher)
            is_joined = any(connection not in before for connection in self._heard_by)
        if is_joined:
            self._joined()
