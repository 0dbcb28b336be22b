"""ROS 2 for the simulated robot's topics and actions."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from robots.simulator.ros2.goals import ActionGoals
from robots.simulator.ros_side import NANO, Goals, Stamp

REPAIRED = 10  # messages of which lost parts are sent again; with one, a busy computer never gets a large picture whole
LISTENS = 100  # messages that wait where nobody asks for fewer


class TopicPublisher:
    """A topic that a node advertises."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher

    @property
    def wanted(self) -> bool:
        return bool(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        self._publisher.publish(message)


class RclpySide:
    """`robots.simulator.ros_side.RosSide`, for nodes in one namespace and in the domain of this process."""

    def __init__(self, name: str, namespace: str, context: Context) -> None:
        self._namespace = namespace
        self._context = context
        # Kilted's EventsExecutor loses messages.
        self._executor = SingleThreadedExecutor(context=context)
        self.node = self.add_node(name)

    def add_node(self, name: str) -> Node:
        """Return one more node."""
        node = Node(
            name,
            namespace=self._namespace,
            context=self._context,
            cli_args=[],
            use_global_arguments=False,
            enable_rosout=False,
        )
        self._executor.add_node(node)
        return node

    def spin(self) -> None:
        """Hand over messages, until the context is shut down."""
        self._executor.spin()

    def close(self) -> None:
        """End `spin`."""
        self._executor.shutdown(timeout_sec=0.0)

    def serve(self, node: Node, name: str, kind: str, answer: Callable[[Any, Any], Any]) -> None:
        """Serve a service by a node."""
        node.create_service(interface(kind, "srv"), self._resolved(name), answer)

    def publisher(
        self, topic: str, kind: str, *, queue: int = 1, kept: bool = False, sensor: bool = False
    ) -> TopicPublisher:
        profile = QoSProfile(
            depth=queue if kept else max(queue, REPAIRED),
            reliability=ReliabilityPolicy.BEST_EFFORT if sensor else ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )
        return TopicPublisher(self.node.create_publisher(interface(kind), self._resolved(topic), profile))

    def subscribe(
        self, topic: str, kind: str, take: Callable[[Any], None], *, queue: int | None = None
    ) -> None:
        self.node.create_subscription(interface(kind), self._resolved(topic), take, queue or LISTENS)

    def goals(self, action: str, kind: str, node: Node | None = None) -> Goals:
        return ActionGoals(
            node or self.node, self._executor, self._resolved(action), interface(kind, "action")
        )

    def sender(self, node: Node, action: str, kind: str) -> Callable[..., Any]:
        """Return what sends a goal with these fields to an action, as a client of a node."""
        goal = interface(kind, "action").Goal
        client = ActionClient(node, interface(kind, "action"), self._resolved(action))
        return lambda **fields: client.send_goal_async(goal(**fields))

    def now(self) -> Stamp:
        return time.time_ns()

    def new(self, kind: str, **fields: Any) -> Any:
        return interface(kind)(**fields)

    def stamped(self, message: Any, stamp: Stamp, frame: str = "") -> Any:
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANO)
        message.header.frame_id = frame
        return message

    def calibrated(self, info: Any, **matrices: list[float]) -> Any:
        for letter, matrix in matrices.items():
            setattr(info, letter, matrix)
        return info

    def seconds(self, duration: Any) -> float:
        return float(duration.sec + duration.nanosec / NANO)

    def octets(self, data: bytes) -> array[int]:
        return array("B", data)

    def octet(self, value: int) -> bytes:
        return bytes([value])

    def _resolved(self, name: str) -> str:
        return f"{self._namespace.rstrip('/')}{name}"


@cache
def interface(kind: str, group: str = "msg") -> type[Any]:
    """Return the class of a message, service or action by its bare name, such as ``nav_msgs/Path``."""
    package, _, short = kind.partition("/")
    found: type[Any] = getattr(import_module(f"{package}.{group}"), short)
    return found
