"""``python -m robots.bridge.ros.map``: takes the robot's map once, for its bridge. JSON in, MessagePack out.

A process of its own, because a map has up to 16 MB and the control loop decodes none; over within `END_S`. It listens
by a TCPROS handshake rather than as a rospy node, so nothing is registered with the robot's master.
"""

from __future__ import annotations

import signal
import sys
import time

import msgspec

from robots.bridge.maps import END_S, MapWanted, NoMap
from robots.bridge.occupancy import LARGEST_MESSAGE, BadMap, taken
from robots.bridge.ros.master import Master, MasterError
from robots.bridge.ros.tcpros import connect_to_publisher, read, read_header, read_length
from robots.bridge.ros.types import message_class
from robots.bridge.sink import TakenMap
from robots.ending import leave_within

CALLER = "/fleet_map"
MESSAGE_S = 5.0  # a map is latched: it comes at once


def take(wanted: MapWanted) -> TakenMap | NoMap:
    """The map as the first publisher tells it that can be reached."""
    master = Master(wanted.master_uri, CALLER)
    why = f"nobody publishes {wanted.topic.name}"
    try:
        for node in master.system_state().publishers.get(wanted.topic.name, []):
            try:
                return taken(_message(wanted, master.node_uri(node)))
            except (OSError, MasterError, ValueError) as error:  # a BadMap is one, too
                why = f"{node}: {error}"
    except MasterError as error:
        why = str(error)
    return NoMap(why)


def _message(wanted: MapWanted, node_uri: str | None) -> bytes:
    """The first message of a publisher."""
    if node_uri is None:
        raise ValueError("the master does not know where it is")
    until_s = time.monotonic() + MESSAGE_S
    with connect_to_publisher(wanted.topic.name, node_uri, CALLER) as connection:
        offered = read_header(connection)
        if offered.get("md5sum") != message_class(wanted.topic.type)._md5sum:
            raise ValueError(
                offered.get("error") or f"it tells a {offered.get('type')} that is another one here"
            )
        connection.settimeout(max(until_s - time.monotonic(), 0.1))
        length = read_length(connection)
        if length > LARGEST_MESSAGE:
            raise BadMap(f"a message of {length} bytes is too large")
        return read(connection, length)


def main() -> None:
    """One question, one answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # from a terminal it is for the bridge, which ends us
    leave_within(END_S)
    wanted = msgspec.json.decode(sys.stdin.buffer.read(), type=MapWanted)
    sys.stdout.buffer.write(msgspec.msgpack.encode(take(wanted)))


if __name__ == "__main__":
    main()
