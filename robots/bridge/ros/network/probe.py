"""``python -m robots.bridge.ros.network.probe``: reads a plan from stdin, writes findings to stdout, both JSON.

Subscribes by a TCPROS handshake instead of a rospy node: the publisher then sends its type and md5 sum even if they
differ from ours, and nothing stays registered with the master. Runs in the environment of the robot's
bridge (`robots.supervisor.ros_environment`), so that names resolve as for the bridge.
"""

from __future__ import annotations

import math
import secrets
import socket
import struct
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import msgspec
from rosgraph.network import get_host_name

from robots.bridge.robot.description.described import described
from robots.bridge.ros.network.tcpros import Conversation, first_response
from robots.shared import wire
from robots.shared.configuration.bridge_config import ArmSource
from robots.shared.configuration.robot_ros import ros1
from robots.shared.graph import SystemState
from robots.shared.processes.probe_findings import (
    CALLER,
    CallbackFound,
    DescriptionFound,
    DriveFound,
    Findings,
    HostFound,
    Listened,
    Plan,
    TopicFound,
)
from robots.shared.ros.master import Master, MasterError
from robots.shared.ros.message_types.classes import UnknownTypeError, message_class
from robots.shared.sentences import joined, reason_of, say

CALLBACK_S = 2.0
DESCRIPTION_S = 5.0  # a description has hundreds of kilobytes, and may come by radio
NODE_S = 3.0  # a busy robot answers late
HEAD = 512  # bytes read of a message: its std_msgs/Header
RANGE = "sensor_msgs/Range"
RANGE_AT = 1 + 3 * 4  # bytes after the header: type of radiation, field of view, least and largest range


def probe(plan: Plan) -> Findings:
    """Check the robot as planned; takes a few seconds at most."""
    master_uri = ros1(plan.ros).master_uri
    master = Master(master_uri, CALLER)
    try:
        state = master.system_state()
        uris = _node_uris(master, state)
    except MasterError as error:
        return Findings(master_error=reason_of(error))
    with ThreadPoolExecutor(len(plan.listened) + 2) as pool:
        hosts = pool.submit(_hosts, uris)
        callback = pool.submit(_callback, master)
        topics = list(pool.map(lambda asked: _topic(asked, state, uris, plan.listen_s), plan.listened))
        return Findings(
            hosts=hosts.result(),
            callback=callback.result(),
            topics=topics,
            drive=_drive(plan, state),
            description=_description(plan.arm, master_uri),
            clock_is_simulated=master.parameter("/use_sim_time") is True,
        )


def _drive(plan: Plan, state: SystemState) -> DriveFound:
    topic = plan.drive.name
    return DriveFound(
        state.publishers.get(topic, []), state.subscribers.get(topic, []), state.types.get(topic)
    )


def _description(arm: ArmSource | None, master_uri: str) -> DescriptionFound:
    try:
        description = Master(master_uri, CALLER, DESCRIPTION_S).parameter("/robot_description")
    except MasterError as error:
        return DescriptionFound(error=reason_of(error))
    return described(arm, description)


# --- names ---------------------------------------------------------------------------------------


def _node_uris(master: Master, state: SystemState) -> dict[str, str]:
    """Return every node's XML-RPC address."""
    sides = (state.publishers, state.subscribers)
    nodes = {node for side in sides for names in side.values() for node in names}
    found = {node: master.node_uri(node) for node in sorted(nodes)}
    return {node: uri for node, uri in found.items() if uri}


def _hosts(uris: dict[str, str]) -> list[HostFound]:
    """Check each host name that nodes advertise, by connecting to one node of it."""
    names = Counter(urlsplit(uri).hostname or "" for uri in uris.values())
    one_of = {urlsplit(uri).hostname or "": uri for uri in uris.values()}
    with ThreadPoolExecutor(16) as pool:
        return list(pool.map(lambda item: _host(item[0], item[1], one_of[item[0]]), names.items()))


def _host(name: str, nodes: int, uri: str) -> HostFound:
    try:
        address = socket.gethostbyname(name)
    except OSError:
        return HostFound(name, nodes)
    try:
        socket.create_connection((address, urlsplit(uri).port or 80), NODE_S).close()
    except OSError as error:
        return HostFound(name, nodes, address, str(error))
    return HostFound(name, nodes, address)


class _QuietHandler(SimpleXMLRPCRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Write nothing to stderr."""


def _callback(master: Master) -> CallbackFound:
    """Publish and subscribe to a random topic: the master must then call the subscriber, which is this process."""
    advertised, route = get_host_name(), _route(master.uri)
    called = threading.Event()

    def publisher_update(*_caller_topic_publishers: Any) -> tuple[int, str, int]:
        called.set()
        return 1, "", 0

    with SimpleXMLRPCServer(("", 0), _QuietHandler, logRequests=False) as server:
        server.register_function(publisher_update, "publisherUpdate")
        serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        serving.start()
        uri = f"http://{advertised}:{server.server_address[1]}/"
        try:
            _provoke(master, uri, called)
        except MasterError as error:
            return CallbackFound(advertised, False, route, reason_of(error))
        finally:
            server.shutdown()
    return CallbackFound(advertised, called.is_set(), route)


def _provoke(master: Master, uri: str, called: threading.Event) -> None:
    topic = f"{CALLER}/{secrets.token_hex(8)}"
    master.register("registerSubscriber", topic, "std_msgs/Empty", uri)
    try:
        master.register("registerPublisher", topic, "std_msgs/Empty", uri)
        called.wait(CALLBACK_S)
    finally:
        master.call("unregisterPublisher", topic, uri)
        master.call("unregisterSubscriber", topic, uri)


def _route(master_uri: str) -> str | None:
    """Return this computer's address in the master's network. Connecting a datagram socket sends nothing."""
    parts = urlsplit(master_uri)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        try:
            datagrams.connect((parts.hostname or "", parts.port or 80))
        except OSError:
            return None
        address: str = datagrams.getsockname()[0]
        return address


# --- topics --------------------------------------------------------------------------------------


def _topic(asked: Listened, state: SystemState, uris: dict[str, str], listen_s: float) -> TopicFound:
    """Return the topic's type and md5 sum, from the first publisher that can be reached."""
    publishers = state.publishers.get(asked.topic, [])
    found = TopicFound(asked.what, publishers, state.types.get(asked.topic), our_md5=_our_md5(asked.type))

    def read(conversation: Conversation) -> TopicFound:
        return _listen(conversation, asked, found, listen_s)

    addresses = {node: uris.get(node) for node in publishers}
    heard, unheard = first_response(read, asked.topic, addresses, CALLER, NODE_S)
    errors = [say("{node}: {why}", node=node, why=why) for node, why in unheard.items()]
    return heard or msgspec.structs.replace(found, error=joined("; ", errors) if errors else None)


def _our_md5(type_name: str) -> str | None:
    try:
        md5: str = message_class(type_name)._md5sum
    except UnknownTypeError:
        return None
    return md5


def _listen(conversation: Conversation, asked: Listened, found: TopicFound, listen_s: float) -> TopicFound:
    """Read until all expected messages arrived, or the time is over."""
    offered = conversation.read_header()
    if "error" in offered:
        raise ValueError(offered["error"])
    messages, frames, skews, ranges = 0, set[str](), list[float](), dict[str, float]()
    conversation.until_s = time.monotonic() + listen_s
    as_asked = offered.get("type") == asked.type  # the layout of another type is unknown
    try:
        while messages == 0 or (as_asked and asked.frames and not frames.issuperset(asked.frames)):
            head = _read_message(conversation)
            messages += 1
            if as_asked and asked.stamped:
                stamp_s, frame = _stamp_and_frame(head)
                frames.add(frame)
                skews.append(stamp_s - time.time())
                if asked.type == RANGE:
                    ranges |= _range(head, frame)
    except TimeoutError:
        pass  # the messages read so far are the answer
    return msgspec.structs.replace(
        found,
        type=offered.get("type"),
        md5=offered.get("md5sum"),
        messages=messages,
        frames=sorted(frames),
        ranges=ranges,
        skew_s=max(skews, default=None),
    )


def _read_message(conversation: Conversation) -> bytes:
    """Return the first `HEAD` bytes of the next message; read and drop the rest."""
    length = conversation.read_length()
    head = conversation.read(min(length, HEAD))
    left = length - len(head)
    while left:
        left -= len(conversation.read(min(left, 1 << 16)))
    return head


def _stamp_and_frame(head: bytes) -> tuple[float, str]:
    """Return stamp (s) and frame id of the std_msgs/Header at the beginning of the message."""
    _seq, seconds, nanoseconds, length = struct.unpack_from("<IIII", head)
    return seconds + nanoseconds * 1e-9, head[16 : 16 + length].decode(errors="replace")


def _range(head: bytes, frame: str) -> dict[str, float]:
    """Return a sensor_msgs/Range's range (m) by frame; nothing if JSON cannot express it (not finite)."""
    length = struct.unpack_from("<I", head, 12)[0]
    (range_m,) = struct.unpack_from("<f", head, 16 + length + RANGE_AT)
    return {frame: range_m} if math.isfinite(range_m) else {}


if __name__ == "__main__":
    sys.stdout.buffer.write(wire.encode(probe(msgspec.json.decode(sys.stdin.buffer.read(), type=Plan))))
