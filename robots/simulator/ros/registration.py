"""Keeps the robot on its master's books: rospy registers once, and a master that was restarted knows nobody."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from xmlrpc.client import ServerProxy

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import rosgraph
import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

log = logging.getLogger(__name__)

_LOOK_EVERY_S = 0.5


def watch_registration(stop: threading.Event, set_parameters: Callable[[], None]) -> None:
    """Look after the registration until `stop`, on a thread of its own."""
    threading.Thread(target=_watch, args=(stop, set_parameters), name="registration", daemon=True).start()


def _watch(stop: threading.Event, set_parameters: Callable[[], None]) -> None:
    master = rosgraph.Master(rospy.get_name())
    while not stop.wait(_LOOK_EVERY_S):
        try:
            if not _is_known(master):
                _register(master)
                set_parameters()
                log.info("registered again with the master, which had been restarted")
        except (OSError, rosgraph.MasterException):
            continue  # no master just now, or it went while we were talking


def _is_known(master: rosgraph.Master) -> bool:
    try:
        master.lookupNode(rospy.get_name())
    except rosgraph.MasterError:
        return False
    return True


def _register(master: rosgraph.Master) -> None:
    """Tell the master all that rospy told its predecessor."""
    own = rospy.get_node_uri()
    for topic, kind in get_topic_manager().get_publications():
        master.registerPublisher(topic, kind, own)
    for topic, kind in get_topic_manager().get_subscriptions():
        publishers = master.registerSubscriber(topic, kind, own)
        # As the master itself would tell this node of publishers.
        ServerProxy(own).publisherUpdate(master.caller_id, topic, publishers)
    for service, uri in get_service_manager().get_services():
        master.registerService(service, uri, own)
