"""``python -m robots.bridge.ros.sensors.map``: fetches the robot's map once. Reads JSON, writes MessagePack.

A separate process, because a map has up to 16 MB and the control loop must not decode it; it ends within `END_S`. It
subscribes by a TCPROS handshake instead of a rospy node, so nothing is registered with the robot's master.
"""

from __future__ import annotations

import signal
import sys
import time

import msgspec

from robots.bridge.audit.record_sink import TakenMap
from robots.bridge.maps.map_fetch import END_S, MapWanted, NoMap
from robots.bridge.maps.occupancy import LARGEST_MESSAGE, BadMap, taken
from robots.bridge.ros.message_types.classes import message_class
from robots.bridge.ros.network.master import Master, MasterError
from robots.bridge.ros.network.tcpros import Conversation, first_response
from robots.processes.shutdown import exit_within

CALLER = "/fleet_map"
MESSAGE_S = 5.0  # the map's topic is latched: its publisher sends the map at once


def take(wanted: MapWanted) -> TakenMap | NoMap:
    """Return the map of the first publisher that can be reached."""
    master, name = Master(wanted.master_uri, CALLER), wanted.topic.name
    try:
        nodes = master.system_state().publishers.get(name, [])
        addresses = {node: master.node_uri(node) for node in nodes}
    except MasterError as error:
        return NoMap(str(error))

    def read(conversation: Conversation) -> TakenMap:
        return taken(_message(conversation, wanted))

    heard, unheard = first_response(read, name, addresses, CALLER)
    whys = "; ".join(f"{node}: {why}" for node, why in unheard.items())
    return heard or NoMap(whys or f"nobody publishes {name}")


def _message(conversation: Conversation, wanted: MapWanted) -> bytes:
    """Return the first message of a publisher. Raises ValueError for another definition of the type."""
    offered = conversation.read_header()
    if offered.get("md5sum") != message_class(wanted.topic.type)._md5sum:
        found = offered.get("type")
        why = f"its definition of {found} differs from the console’s"
        if found != wanted.topic.type:
            why = f"it publishes {found}, not {wanted.topic.type}"
        raise ValueError(offered.get("error") or why)
    conversation.until_s = time.monotonic() + MESSAGE_S
    length = conversation.read_length()
    if length > LARGEST_MESSAGE:
        raise BadMap(f"a message of {length} bytes is too large")
    return conversation.read(length)


def main() -> None:
    """Answer one request from stdin on stdout."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the bridge handles it and ends this process
    exit_within(END_S)
    wanted = msgspec.json.decode(sys.stdin.buffer.read(), type=MapWanted)
    sys.stdout.buffer.write(msgspec.msgpack.encode(take(wanted)))


if __name__ == "__main__":
    main()
