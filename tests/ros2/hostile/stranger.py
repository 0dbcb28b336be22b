"""A stranger in a robot's domain: ``python -m tests.ros2.hostile.stranger ROLE [NUMBER]``, until stdin ends.

It prints a line when it has begun, and then one for what it has done so far, each second.
"""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rcl_interfaces.msg import Log
from rclpy._rclpy_pybind11 import RCLError
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, String
from tf2_msgs.msg import TFMessage

KB, MB = 1024, 1024 * 1024
ODOMETRY, BATTERY = "/mobile_base_controller/odom", "/power/battery_level"
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
AT_ONCE = 1000  # topics of one node: a domain has few participants

MEMBERS: list[Node] = []  # a node that nobody keeps leaves
Work = Iterator[None]  # each step is one deed


def member(name: str) -> Node:
    context = Context()
    context.init(domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    node = Node(name, context=context, use_global_arguments=False, enable_rosout=False)
    MEMBERS.append(node)
    return node


def leave(node: Node) -> None:
    MEMBERS.remove(node)
    node.destroy_node()
    node.context.shutdown()


def endless(topic: str, message: Any, qos: QoSProfile | int = 1) -> Work:
    """Publish one message again and again."""
    publisher = member("endless").create_publisher(type(message), topic, qos)
    raw = serialize_message(message)
    while True:
        with suppress(RCLError):  # its readers are too slow
            publisher.publish(raw)
        yield


def huge_odometry(size: int) -> Work:
    message = Odometry(child_frame_id="x" * size)
    return endless(ODOMETRY, message)


def huge_log(size: int) -> Work:
    return endless("/rosout", Log(msg="x" * size), 10)


def strings(size: int) -> Work:
    return endless("/strings", String(data="x" * size), 10)


def tiny(_number: int) -> Work:
    return endless(BATTERY, Float32(data=50.0))


def huge_map(side: int) -> Work:
    grid = OccupancyGrid()
    grid.header.frame_id = "map"
    grid.info.width = grid.info.height = side
    grid.info.resolution, grid.info.origin.orientation.w = 0.05, 1.0
    raw = serialize_message(grid)[:-4] + (side * side).to_bytes(4, "little") + bytes(side * side)
    publisher = member("huge_map").create_publisher(OccupancyGrid, "/map", KEPT)
    publisher.publish(raw)
    while True:
        yield
        time.sleep(1.0)


def names(size: int) -> Work:
    """Names of this size in each message that has some."""
    name, node = "n" * size, member("names")
    frame = TransformStamped(child_frame_id=name)
    frame.header.frame_id = name
    said = {
        "/joint_states": JointState(name=[name], position=[1.0]),
        "/tf": TFMessage(transforms=[frame]),
        "/diagnostics": DiagnosticArray(status=[DiagnosticStatus(name=name, message=name, hardware_id=name)]),
        ODOMETRY: Odometry(child_frame_id=name),
    }
    publishers = [
        (node.create_publisher(type(message), topic, 10), serialize_message(message))
        for topic, message in said.items()
    ]
    while True:
        for publisher, raw in publishers:
            with suppress(RCLError):
                publisher.publish(raw)
        time.sleep(0.002)
        yield


def topics(number: int) -> Work:
    """Topics with names as long as a name may be."""
    return many(number, lambda node, at: node.create_publisher(String, f"/t_{at}_{'n' * 200}", 1))


def servers(number: int) -> Work:
    """Servers of actions: what a stop looks for."""
    return many(
        number,
        lambda node, at: node.create_service(
            CancelGoal, f"/a_{at}_{'n' * 150}/_action/cancel_goal", lambda _request, answer: answer
        ),
    )


def many(number: int, make: Callable[[Node, int], Any]) -> Work:
    for at in range(number):
        if at % AT_ONCE == 0:
            node = member(f"many_{at}")
        make(node, at)  # the node keeps it
        yield
    while True:
        time.sleep(1.0)
        yield


def comers(_number: int) -> Work:
    """Participants that come and go: each second one dies without a word."""
    count = 0
    while True:
        node = member(f"comer_{count}")
        node.create_publisher(Odometry, ODOMETRY, 1)  # without a word: the bridge believes odometry
        node.create_publisher(Float32, BATTERY, 1).publish(Float32(data=50.0))
        count += 1
        if count % 2:
            leave(node)
        else:
            MEMBERS.remove(node)
            node.context.shutdown()
        yield


WORK: dict[str, Callable[[int], Work]] = {
    one.__name__: one
    for one in (
        huge_odometry,
        huge_log,
        strings,
        tiny,
        huge_map,
        names,
        topics,
        servers,
        comers,
    )
}


def main() -> None:
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    told_s = float("-inf")
    work = WORK[sys.argv[1]](int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    for count, _ in enumerate(work, 1):
        if time.monotonic() - told_s >= 1.0:
            told_s = time.monotonic()
            print("done", count, flush=True)


if __name__ == "__main__":
    main()
