"""rclpy for `ros_side`, with the functions of `by_rospy`."""

from __future__ import annotations

import os
from array import array
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any

import robots.bridge.ros2  # noqa: F401  (first: makes rclpy importable)

# isort: split
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time

octets = partial(array, "B")  # of pictures
running = rclpy.ok
_nodes: list[Node] = []


def join(name: str) -> None:
    """Become a node, which ends at SIGTERM."""
    rclpy.init()
    _nodes.append(rclpy.create_node(f"{name}_{os.getpid()}", start_parameter_services=False))


def spin() -> None:
    """Hand over messages until SIGTERM."""
    with suppress(ExternalShutdownException):
        rclpy.spin(_nodes[0])
    _nodes[0].destroy_node()  # else others miss it only after 20 s
    os._exit(0)  # its threads never end


def message(kind: str) -> Any:
    """Return a new message of a type such as ``nav_msgs/Path``."""
    package, _, name = kind.partition("/")
    return getattr(import_module(f"{package}.msg"), name)()


def publisher(topic: str, kind: str, queue: int = 1) -> Any:
    """Advertise a topic: reliable, which reaches every listener."""
    return _nodes[0].create_publisher(type(message(kind)), topic, queue)


def has_reader(publisher: Any) -> bool:
    """Return whether somebody reads its topic."""
    return bool(publisher.get_subscription_count())


def subscribe(topic: str, kind: str, take: Callable[[Any], None], *, raw: bool = False) -> None:
    """Read a topic; `raw`: its bytes. Sensors may publish best effort, so they are read so."""
    quality = qos_profile_sensor_data if kind.startswith("sensor_msgs/") else 10
    _nodes[0].create_subscription(type(message(kind)), topic, take, quality, raw=raw)


def stamp(time_ns: int) -> Any:
    """Return a time of a header."""
    return Time(nanoseconds=time_ns).to_msg()
