"""Installs the bounds in rospy, once in a process and before its node starts."""

from __future__ import annotations

import socket
from collections.abc import Callable
from functools import partialmethod
from typing import Any

import rosgraph.network
import rosgraph.xmlrpc
from rospy.impl import masterslave, tcpros_base, tcpros_pubsub

from robots.bridge.ros.bounds import listening, servers
from robots.bridge.ros.bounds.logs import keep_our_log, spare_the_log

MASTER_TIMEOUT_S = 60.0  # time limit of rospy's own calls to the master


def install(exhausted: Callable[[], None]) -> None:
    """Limit what rospy reads and from which nodes. rospy's threads call `exhausted` when memory ends."""
    keep_our_log()
    spare_the_log()
    socket.setdefaulttimeout(MASTER_TIMEOUT_S)  # rospy sets the same limit with its first subscription
    listening.Transport.exhausted = staticmethod(exhausted)
    tcpros_pubsub.TCPROSSub = listening.Listening
    tcpros_pubsub.TCPROSTransport = listening.Transport
    tcpros_pubsub.robust_connect_subscriber = listening.receive
    tcpros_base.read_ros_handshake_header = servers.read_header
    tcpros_base.TCPROSServer._tcp_server_callback = partialmethod(
        servers.take_connection, exhausted=exhausted
    )
    masterslave.RegManager = listening.Manager
    masterslave.ROSHandler.publisherUpdate = _publisher_update
    rosgraph.xmlrpc.ThreadingXMLRPCServer = servers.Server
    rosgraph.network.get_bind_address = servers.bind_address


def _publisher_update(
    handler: Any, _caller: object, topic: object, publishers: object
) -> tuple[int, str, int]:
    """Replace rospy's handler: with n publishers, it starts n requests to each of them."""
    if not isinstance(topic, str) or not isinstance(publishers, list):
        return -1, "a topic and its publishers are needed", 0
    handler.reg_man.publisher_update(topic, publishers)
    return 1, "", 0
