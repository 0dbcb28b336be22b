"""Measures how long the robot's computer takes to acknowledge twists on its drive topic.

The kernel reports how many sent bytes of a connection are not acknowledged yet (tcp(7), SIOCOUTQ).
"""

from __future__ import annotations

import fcntl
import struct
import termios
from typing import Any

import rospy

from robots.bridge.gate.timing.acknowledgements import RoundTrips
from robots.bridge.ros.tasks.publishing import heard_by


class Acknowledgements:
    """The drive topic's connections to the master's computer; if there are none, all its connections.

    A listener on another computer may have a slower network than the robot.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._acknowledgements: dict[Any, RoundTrips] = {}  # by rospy's connection

    def wrote(self, publisher: rospy.Publisher, now_s: float) -> None:
        """Note that a message was published at `now_s`."""
        connections = heard_by(publisher)
        of_robot = [connection for connection in connections if _peer(connection) == self._address]
        self._acknowledgements = {
            connection: self._acknowledgements.get(connection) or RoundTrips()
            for connection in of_robot or connections
        }
        for connection, round_trips in self._acknowledgements.items():
            round_trips.wrote(connection.stat_bytes, now_s)

    def took_s(self, now_s: float) -> float | None:
        """Return the slowest connection's acknowledgement time (s) since the last call, if there is any."""
        found = [
            round_trips.took_s(connection.stat_bytes - _kept(connection), now_s)
            for connection, round_trips in self._acknowledgements.items()
        ]
        return max((took_s for took_s in found if took_s is not None), default=None)


# rospy closes a connection on another thread, and then drops its socket.
_CLOSED = (OSError, AttributeError, ValueError)


def _peer(connection: Any) -> str:
    """Return the IP address of the other end; empty if the connection is closed."""
    try:
        return str(connection.socket.getpeername()[0])
    except _CLOSED:
        return ""


def _kept(connection: Any) -> int:
    """Return the bytes that the other end has not acknowledged."""
    try:
        kept: int = struct.unpack("i", fcntl.ioctl(connection.socket.fileno(), termios.TIOCOUTQ, bytes(4)))[0]
    except _CLOSED:
        return 0
    return kept
