"""``python -m robots.bridge.ros.sensors.map``: see `robots.bridge.maps.map_process`.

It subscribes by a TCPROS handshake instead of a rospy node, so nothing is registered with the robot's master.
"""

from __future__ import annotations

import errno
import struct
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.bridge.maps.map_process import Without, agreed, run
from robots.bridge.ros.network.tcpros import Conversation, connect_to_publisher
from robots.shared.configuration.robot_ros import ros1
from robots.shared.maps.occupancy import LARGEST_MESSAGE, BadMap, taken
from robots.shared.records.record_sink import TakenMap
from robots.shared.ros.master import Master, MasterError
from robots.shared.ros.message_types.classes import message_class
from robots.shared.sentences import reason_of, say

CALLER = "/fleet_map"
MESSAGE_S = 5.0  # the map's topic is latched: its publisher sends the map at once
UNREACHED = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN)
AT_ONCE = 3  # publishers that are read at the same time: a map has up to 16 MB


def read_map(wanted: MapWanted) -> TakenMap | NoMap:
    """Return the map on which all publishers agree. If they differ, navigation may have any of them."""
    master, name = Master(ros1(wanted.ros).master_uri, CALLER), wanted.topic.name
    try:
        nodes = master.system_state().publishers.get(name, [])
        addresses = {node: master.node_uri(node) for node in nodes}
    except MasterError as error:
        return NoMap(reason_of(error))
    with ThreadPoolExecutor(AT_ONCE) as readers:
        answers = readers.map(partial(_map_of, wanted), addresses.values())
        return agreed(dict(zip(addresses, answers, strict=True)), name)


def _map_of(wanted: MapWanted, address: str | None) -> TakenMap | NoMap | Without:
    """Return the map of the publisher with this XML-RPC address; None: the master has no address of it."""
    if address is None:
        return Without(say("has no address at the master"))
    try:
        with connect_to_publisher(wanted.topic.name, address, CALLER) as conversation:
            message = _message(conversation, wanted)
            return message if isinstance(message, Without) else taken(message)
    except (OSError, MasterError, ValueError, struct.error) as error:
        cause = error.__cause__ or error
        if isinstance(cause, ConnectionRefusedError):  # its computer says that the node has ended
            return Without(reason_of(error))
        if isinstance(cause, TimeoutError) or getattr(cause, "errno", None) in UNREACHED:
            # Navigation may reach this node: so it is not passed over, however long it is silent.
            why = say(
                "it does not answer at {address} and may publish another map. If it has ended, or its computer "
                "is off, run “rosnode cleanup” on the robot",
                address=address,
            )
            return NoMap(why)
        return NoMap(reason_of(error))


def _message(conversation: Conversation, wanted: MapWanted) -> bytes | Without:
    """Return the first message of a publisher. Raises ValueError for another definition of the type."""
    offered = conversation.read_header()
    if offered.get("md5sum") != message_class(wanted.topic.type)._md5sum:
        found = offered.get("type")
        why = say("its definition of {type} differs from the console’s", type=found)
        if found != wanted.topic.type:
            why = say("it publishes {type}, not {wanted}", type=found, wanted=wanted.topic.type)
        raise ValueError(offered.get("error") or why)
    conversation.until_s = time.monotonic() + MESSAGE_S
    try:
        length = conversation.read_length()
    except TimeoutError:
        if offered.get("latching") != "1":
            raise  # it may have published a map before
        return Without(say("has published no map yet"))
    if length > LARGEST_MESSAGE:
        raise BadMap(say("a message of {length} bytes is too large", length=length))
    return conversation.read(length)


if __name__ == "__main__":
    run(read_map)
