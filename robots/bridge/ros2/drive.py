"""Velocities of bridge and watchdog to a robot."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterable
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from robots.bridge.ros2.qos import DRIVE
from robots.shared.configuration.bridge_config import Topic
from robots.shared.geometry.poses import STILL, Velocity

NANO = 1_000_000_000
FLUSH_S = 0.1  # in which a message leaves

TWISTS: dict[str, type[Any]] = {
    "geometry_msgs/msg/Twist": Twist,
    "geometry_msgs/msg/TwistStamped": TwistStamped,
}


def kind_heard(drive: Topic, heard: Iterable[str], now: str) -> str:
    """Return the type for velocities: the present one while a listener has it, else as entered, else the only other.

    So no further listener can take the velocities away from the robot. Where none fits, the type stays.
    """
    kinds = {drive.type, *(one.type for one in drive.others)} & set(heard)
    if now in kinds or not kinds:
        return now
    if drive.type in kinds:
        return drive.type
    return kinds.pop() if len(kinds) == 1 else now


def kind_of(publisher: Any) -> str:
    """Return the type of a publisher of velocities."""
    return next(name for name, kind in TWISTS.items() if kind is publisher.msg_type)


# Little-endian CDR: its mark, then a stamp and an empty frame id if there is a header, then linear and angular.
_TWIST, _STAMPED = struct.Struct("<4s6d"), struct.Struct("<4siII4x6d")
_MARK = b"\0\1\0\0"


def velocity_bytes(kind: type[Any], velocity: Velocity, clocks_agree: bool = True) -> bytes:
    """Return a message of this class as it is sent: rclpy would turn an object into these bytes, which takes longer.

    A stamp is this computer's time: controllers refuse old ones. If the robot's clock differs, the stamp is zero: for
    ros2_control that is the time of its own clock.
    """
    x, y, turn = velocity
    if kind is Twist:
        return _TWIST.pack(_MARK, x, y, 0.0, 0.0, 0.0, turn)
    stamp = divmod(time.time_ns(), NANO) if clocks_agree else (0, 0)
    return _STAMPED.pack(_MARK, *stamp, 1, x, y, 0.0, 0.0, 0.0, turn)


def publish_still(publisher: Any) -> None:
    """Publish a zero velocity that the robot takes by any clock: with a stamp of this computer's time, and of zero."""
    kind = publisher.msg_type
    publisher.publish(velocity_bytes(kind, STILL))
    if kind is not Twist:
        publisher.publish(velocity_bytes(kind, STILL, clocks_agree=False))


class Drives:
    """The publishers of velocities, by topic. One thread connects them, others publish meanwhile."""

    def __init__(self, events: PublisherEventCallbacks | None = None) -> None:
        self.by_topic: dict[str, Any] = {}
        self.newest = STILL  # what was to be sent last
        self.sent = 0  # velocities
        self._events = events

    def connect(self, node: Node, topics: Iterable[str], kind: str) -> list[Any]:
        """Keep a publisher of this type for each of these topics, and no other. Return the new ones.

        One of another type stays while the robot is driven. It is there until its last zero has left, and a moment
        without any publisher follows: a process has one type of a topic.
        """
        topics = set(topics)
        changed = [name for name, one in self.by_topic.items() if name in topics and kind_of(one) != kind]
        if changed and self.newest == STILL:
            for name in changed:
                publish_still(self.by_topic[name])
            time.sleep(FLUSH_S)
        if self.newest != STILL:
            changed = []
        left = {name: one for name, one in self.by_topic.items() if name not in topics or name in changed}
        self.by_topic = {name: one for name, one in self.by_topic.items() if name not in left}
        for publisher in left.values():
            node.destroy_publisher(publisher)
        new = []
        for name in topics - self.by_topic.keys():
            publisher = node.create_publisher(TWISTS[kind], name, DRIVE, event_callbacks=self._events)
            self.by_topic = {**self.by_topic, name: publisher}
            new.append(publisher)
        return new

    def are(self, topics: Iterable[str], kind: str) -> bool:
        """Return whether there are publishers of this type for these topics, and no others."""
        return self.by_topic.keys() == set(topics) and all(
            kind_of(one) == kind for one in self.by_topic.values()
        )
