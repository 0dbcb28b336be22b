"""``python -m robots.bridge.ros2.network.probe``: reads a plan from stdin, writes findings to stdout, both JSON.

It joins the robot's domain for a few seconds, in the environment of the robot's bridge
(`robots.supervisor.ros_environment`), and reads only the beginnings of messages.
"""

from __future__ import annotations

import math
import socket
import struct
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import msgspec
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from robots.bridge.robot.description.described import described
from robots.bridge.ros2.network.graph import node_name
from robots.bridge.ros2.participant import guarded
from robots.bridge.ros2.qos import kept
from robots.shared import wire
from robots.shared.configuration.robot_ros import Ros2, ros2
from robots.shared.graph import is_own
from robots.shared.messages.type_names import bare
from robots.shared.processes.probe_findings import (
    CALLER,
    DriveFound,
    Findings,
    Listened,
    Plan,
    TopicFound,
)
from robots.shared.sentences import joined, say

FOUND_S = 3.0  # by which nodes of this network are found
SETTLED_S = 1.0  # from the first node to the last, and its topics
OTHER_DOMAINS = range(10)  # where a robot is looked for that is not in its own
MULTICAST = ("239.255.0.1", 7400)  # where Fast DDS looks for others
STAMP = struct.Struct("<iII")  # of a std_msgs/Header: seconds, nanoseconds, length of the frame id
ENCAPSULATION = 4  # bytes before a message


class Member:
    """A node in one domain."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(
            args=[], context=self.context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        self.node = Node(
            CALLER.strip("/"),
            context=self.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )

    def others(self) -> list[str]:
        """Return the names of all nodes that are no processes of a console."""
        names = (f"{space.rstrip('/')}/{name}" for name, space in self.node.get_node_names_and_namespaces())
        return [name for name in names if not is_own(name) and name != CALLER]

    def close(self) -> None:
        self.node.destroy_node()
        self.context.shutdown()


def probe(plan: Plan) -> Findings:
    """Check the robot as planned; takes a few seconds."""
    ros = ros2(plan.ros)
    member = Member(ros.domain_id)
    try:
        if not _until(lambda: bool(member.others()), FOUND_S):
            return Findings(master_error=_nothing(ros))
        time.sleep(SETTLED_S)
        return _found(member, plan, ros)
    finally:
        member.close()


def _until(is_true: Callable[[], bool], seconds: float) -> bool:
    end_s = time.monotonic() + seconds
    while not is_true():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.05)
    return True


def _nothing(ros: Ros2) -> str:
    """Return why the robot may not be found: where nodes are, and how this computer searched."""
    whys: list[str] = [say("No node answers in domain {domain}.", domain=ros.domain_id)]
    members = {domain: Member(domain) for domain in OTHER_DOMAINS if domain != ros.domain_id}
    try:
        _until(lambda: any(member.others() for member in members.values()), FOUND_S)
        whys += [
            say("{nodes} answers in domain {domain}.", nodes=found[0], domain=domain)
            for domain, member in members.items()
            if (found := member.others())
        ]
    finally:
        for member in members.values():
            member.close()
    if ros.discovery_server:
        whys.append(say("Only the discovery server {server} was asked.", server=ros.discovery_server))
    elif ros.discovery == "localhost":
        whys.append(say("The search stays on this computer."))
    elif ros.discovery == "off":
        whys.append(say("Only the static peers were asked."))
    else:
        whys.append(_searched())
    return joined(" ", whys)


def _searched() -> str:
    """Return where multicast leaves this computer. Connecting a datagram socket sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        try:
            datagrams.connect(MULTICAST)
        except OSError:
            return say("No network of this computer takes multicast.")
        address: str = datagrams.getsockname()[0]
    return say("Multicast leaves this computer from {address}.", address=address)


def _found(member: Member, plan: Plan, ros: Ros2) -> Findings:
    node = member.node
    heard = [_Heard(node, listened) for listened in plan.listened]
    description = _Heard(
        node, Listened("description", f"{ros.namespace}/robot_description", "std_msgs/msg/String", False)
    )
    executor = SingleThreadedExecutor(context=member.context)
    executor.add_node(node)
    end_s = time.monotonic() + plan.listen_s
    while time.monotonic() < end_s and not all(one.done for one in [*heard, description]):
        executor.spin_once(timeout_sec=max(end_s - time.monotonic(), 0.0))
    text = deserialize_message(description.last, String).data if description.last else None
    return Findings(
        topics=[one.found() for one in heard],
        drive=_drive(node, plan),
        description=described(plan.arm, text),
        clock_is_simulated=bool(node.count_publishers("/clock")),
    )


def _drive(node: Node, plan: Plan) -> DriveFound:
    topic = plan.drive.name
    listeners = [one for one in node.get_subscriptions_info_by_topic(topic) if not is_own(node_name(one))]
    types = sorted({one.topic_type for one in listeners} - {plan.drive.type})
    fitting = [one for one in listeners if one.topic_type == plan.drive.type]
    old = DurabilityPolicy.TRANSIENT_LOCAL  # it asks for twists of before, which nobody keeps
    return DriveFound(
        publishers=sorted({node_name(one) for one in node.get_publishers_info_by_topic(topic)}),
        subscribers=sorted({node_name(one) for one in fitting if one.qos_profile.durability != old}),
        type=types[0] if types and not fitting else None,
        refused=sorted({node_name(one) for one in fitting if one.qos_profile.durability == old}),
    )


class _Heard:
    """One topic: its publishers, and the messages that come."""

    def __init__(self, node: Node, listened: Listened) -> None:
        self._listened = listened
        self._publishers = node.get_publishers_info_by_topic(listened.topic)
        self._frames, self._skews = set[str](), list[float]()
        self._ranges: dict[str, float] = {}
        self._messages = 0
        self.last = b""
        kind = _kind(listened.type)
        self._known = kind is not None
        types = {one.topic_type for one in self._publishers}
        self._type = listened.type if listened.type in types else next(iter(sorted(types)), None)
        self.done = kind is None or listened.type not in types
        if not self.done:
            offered = kept(one.qos_profile for one in self._publishers)
            node.create_subscription(kind, listened.topic, guarded(self._take), offered, raw=True)

    def _take(self, raw: bytes) -> None:
        self._messages, self.last = self._messages + 1, raw
        if self._listened.stamped:
            seconds, nanoseconds, length = STAMP.unpack_from(raw, ENCAPSULATION)
            begin = ENCAPSULATION + STAMP.size
            frame = raw[begin : begin + length - 1].decode(errors="replace")
            self._frames.add(frame)
            self._skews.append(seconds + nanoseconds * 1e-9 - time.time())
            if bare(self._listened.type) == "sensor_msgs/Range":
                self._ranges |= _range(raw, begin + length, frame)
        self.done = self._frames.issuperset(self._listened.frames)

    def found(self) -> TopicFound:
        names = [node_name(one) for one in self._publishers]
        return TopicFound(
            self._listened.what,
            names,
            type=self._type,
            md5="",
            our_md5="" if self._known else None,
            messages=self._messages,
            frames=sorted(self._frames),
            ranges=self._ranges,
            skew_s=max(self._skews, default=None),
        )


def _range(raw: bytes, end: int, frame: str) -> dict[str, float]:
    """Return a sensor_msgs/Range's range (m) by frame; nothing if JSON cannot express it (not finite)."""
    at = end + 1  # behind the type of radiation
    at += -(at - ENCAPSULATION) % 4 + 3 * 4  # field of view, least and largest range
    (range_m,) = struct.unpack_from("<f", raw, at)
    return {frame: range_m} if math.isfinite(range_m) else {}


def _kind(type_name: str) -> type[Any] | None:
    """Return the class of a message; None if its package is missing here."""
    package, folder, name = type_name.split("/")
    try:
        found: type[Any] = getattr(import_module(f"{package}.{folder}"), name)
    except (ImportError, AttributeError):
        return None
    return found


if __name__ == "__main__":
    sys.stdout.buffer.write(wire.encode(probe(msgspec.json.decode(sys.stdin.buffer.read(), type=Plan))))
