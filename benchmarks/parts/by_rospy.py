"""rospy for `ros_side`, with the functions of `by_rclpy`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

import rospy

octets = bytes  # of pictures
spin = rospy.spin


def running() -> bool:
    """Return whether this node has not ended."""
    return not rospy.is_shutdown()


def join(name: str) -> None:
    """Become a node."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    rospy.init_node(name, anonymous=True, disable_signals=True)


def message(kind: str) -> Any:
    """Return a new message of a type such as ``nav_msgs/Path``."""
    package, _, name = kind.partition("/")
    return getattr(import_module(f"{package}.msg"), name)()


def publisher(topic: str, kind: str, queue: int = 1) -> Any:
    """Advertise a topic."""
    return rospy.Publisher(topic, type(message(kind)), queue_size=queue, tcp_nodelay=True)


def has_reader(publisher: Any) -> bool:
    """Return whether somebody reads its topic."""
    return bool(publisher.get_num_connections())


def subscribe(topic: str, kind: str, take: Callable[[Any], None], *, raw: bool = False) -> None:
    """Read a topic; `raw`: its bytes."""
    rospy.Subscriber(topic, rospy.AnyMsg if raw else type(message(kind)), take, tcp_nodelay=True)


def stamp(time_ns: int) -> Any:
    """Return a time of a header."""
    return rospy.Time(*divmod(time_ns, 1_000_000_000))
