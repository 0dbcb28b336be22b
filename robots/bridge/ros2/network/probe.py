"""``python -m robots.bridge.ros2.network.probe``: reads a plan from stdin, writes findings to stdout, both JSON.

It joins the robot's domain for a few seconds, in the environment of the robot's bridge
(`robots.supervisor.ros_environment`), and reads only the beginnings of messages.
"""

from __future__ import annotations

import math
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import msgspec
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String

from robots.bridge.robot.description.described import described
from robots.bridge.ros2.definitions import type_hash
from robots.bridge.ros2.drive import kind_heard
from robots.bridge.ros2.message_types import TypeUnknown, message_class
from robots.bridge.ros2.network.clock import SimulatedClock
from robots.bridge.ros2.network.graph import Graph, node_name, nodes
from robots.bridge.ros2.network.offers import lacking, refused
from robots.bridge.ros2.network.parameters import NodeParameters
from robots.bridge.ros2.network.searching import (
    FOUND_S,
    LEAVE_S,
    others,
    unknown_address,
    why_not_found,
)
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import DRIVE, STATIC, as_offered, kept
from robots.bridge.ros2.versions import other_hash
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2, ros2
from robots.shared.graph import is_own
from robots.shared.messages.type_names import bare
from robots.shared.processes.probe_findings import (
    CALLER,
    FEEDBACK,
    TYPE,
    DriveFound,
    Findings,
    Listened,
    Misfit,
    Plan,
    TopicFound,
)
from robots.shared.sentences import say

SETTLED_S = 1.0  # from the first node to the last, and its topics
CONNECTED_S = 2.0  # until DDS has connected a subscription, on a busy computer
LOOK_S = 0.05
LARGEST = 32 * 1024 * 1024  # bytes of a message
STAMP = struct.Struct("<iII")  # of a std_msgs/Header: seconds, nanoseconds, length of the frame id
ENCAPSULATION = 4  # bytes before a message


def probe(plan: Plan) -> Findings:
    """Check the robot as planned; takes a few seconds."""
    ros = ros2(plan.ros)
    if (peer := unknown_address(ros)) is not None:
        return Findings(master_error=say("The address of {peer} is not known on this computer.", peer=peer))
    participant = Participant(CALLER.strip("/"), ros.domain_id)
    try:
        if _until(lambda: bool(others(participant)), FOUND_S):
            time.sleep(SETTLED_S)
            return _found(participant, plan, ros)
    finally:
        participant.close(LEAVE_S)
    return Findings(master_error=why_not_found(plan, ros))


def _until(is_true: Callable[[], bool], seconds: float) -> bool:
    end_s = time.monotonic() + seconds
    while not is_true():
        if time.monotonic() > end_s:
            return False
        time.sleep(LOOK_S)
    return True


def _found(participant: Participant, plan: Plan, ros: Ros2) -> Findings:
    description = Listened(
        "description", f"{ros.namespace}/robot_description", "std_msgs/msg/String", False, kept="may"
    )
    heard = [_Heard(participant, one) for one in [*plan.listened, description]]
    participant.start()
    _until(lambda: all(one.done for one in heard), plan.listen_s + CONNECTED_S)
    last = heard.pop().last
    clock = SimulatedClock(Graph(participant.node), NodeParameters(participant), plan.listened[0].topic)
    return Findings(
        topics=[one.found() for one in heard],
        drive=_commanded(participant, plan.drive),
        commands={what: _commanded(participant, topic) for what, topic in plan.commands.items()},
        description=described(plan.arm, deserialize_message(last, String).data if last else None),
        clock_is_simulated=clock.look(),
        twins=sorted(name for name, count in Counter(others(participant)).items() if count > 1),
        namespaces=_namespaces(participant, plan, ros),
    )


def _namespaces(participant: Participant, plan: Plan, ros: Ros2) -> list[str]:
    """Return the namespaces in which the robot's odometry is, if it is not where the registry says."""
    node, odometry = participant.node, plan.listened[0].topic
    if node.count_publishers(odometry):
        return []
    end = odometry.removeprefix(ros.namespace)
    names = (name for name, _ in node.get_topic_names_and_types() if name.endswith(end))
    return sorted(name.removesuffix(end) for name in names if node.count_publishers(name))


def _commanded(participant: Participant, topic: Topic) -> DriveFound:
    """Return who gets what the console publishes on a topic."""
    node = participant.node
    listeners = [
        one for one in node.get_subscriptions_info_by_topic(topic.name) if not is_own(node_name(one))
    ]
    kind = kind_heard(topic, [one.topic_type for one in listeners], topic.type)
    types = sorted({one.topic_type for one in listeners} - {kind})
    fitting = [one for one in listeners if one.topic_type == kind]
    unfit = refused(DRIVE, fitting)
    if fitting:
        strange = [one for one in listeners if one.topic_type != kind]
        unfit += [Misfit(node_name(one), TYPE, kind, one.topic_type) for one in strange]
    return DriveFound(
        publishers=sorted(map(node_name, node.get_publishers_info_by_topic(topic.name))),
        subscribers=sorted({*nodes(fitting)} - {one.node for one in unfit if one.policy != TYPE}),
        type=types[0] if types and not fitting else None,
        refused=unfit,
        differing=nodes(one for one in fitting if _theirs(one)),
        takes=kind,
    )


def _theirs(endpoint: TopicEndpointInfo) -> str:
    """Return the type hash of an endpoint if it differs from ours."""
    return other_hash(endpoint, type_hash(endpoint.topic_type))


class _Heard:
    """One topic: its publishers, and the messages that come."""

    def __init__(self, participant: Participant, listened: Listened) -> None:
        self._listened = listened
        self._publishers = participant.node.get_publishers_info_by_topic(listened.topic)
        self._frames, self._skews = set[str](), list[float]()
        self._ranges: dict[str, float] = {}
        self._messages = 0
        self.last = b""
        kind = _class(listened.type)
        self._known = kind is not None
        self._fitting = [one for one in self._publishers if one.topic_type == listened.type]
        is_read = self._known and bool(self._fitting)
        found_types = sorted({one.topic_type for one in self._publishers})
        self._type = listened.type if self._fitting else next(iter(found_types), None)
        self.done = not is_read or listened.type.endswith(FEEDBACK)  # whose actions may stay silent for hours
        if is_read:
            asked = kept if listened.kept == "may" else as_offered
            offered = asked(one.qos_profile for one in self._fitting)
            qos = STATIC if listened.kept == "must" else offered
            participant.listen(listened.topic, kind, self._take, qos, LARGEST)

    def _take(self, raw: bytes, _info: Any) -> None:
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
        theirs = next(filter(None, map(_theirs, self._fitting)), "")
        ours = type_hash(self._listened.type) if theirs else ""
        return TopicFound(
            self._listened.what,
            [node_name(one) for one in self._fitting or self._publishers],
            type=self._type,
            md5=theirs,
            our_md5=ours if self._known else None,
            messages=self._messages,
            frames=sorted(self._frames),
            ranges=self._ranges,
            skew_s=max(self._skews, default=None),
            misfits=self._misfits(),
        )

    def _misfits(self) -> list[Misfit]:
        """Return the publishers that keep nothing for the console, which comes later."""
        kept_by = self._listened.kept
        if kept_by == "must" or (kept_by == "may" and not self._messages):
            return lacking(self._fitting, STATIC)
        return []


def _range(raw: bytes, end: int, frame: str) -> dict[str, float]:
    """Return a sensor_msgs/Range's range (m) by frame; nothing if JSON cannot express it (not finite)."""
    at = end + 1  # behind the type of radiation
    at += -(at - ENCAPSULATION) % 4 + 3 * 4  # field of view, least and largest range
    (range_m,) = struct.unpack_from("<f", raw, at)
    return {frame: range_m} if math.isfinite(range_m) else {}


def _class(type_name: str) -> Any:
    """Return the class of a message; None if its package is missing here."""
    try:
        return message_class(type_name)
    except TypeUnknown:
        return None


if __name__ == "__main__":
    sys.stdout.buffer.write(wire.encode(probe(msgspec.json.decode(sys.stdin.buffer.read(), type=Plan))))
