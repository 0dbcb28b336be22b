"""Keeps the robot registered at its master: rospy registers only once, but the master may restart."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

import rosgraph
import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

from robots.shared.ros.master import Master, MasterError
from robots.shared.ros.registration import register_again

log = logging.getLogger(__name__)

_CHECK_EVERY_S = 0.5


def watch_registration(stop: threading.Event, set_parameters: Callable[[], None]) -> None:
    """Check the registration until `stop`, on a separate thread."""
    threading.Thread(target=_watch, args=(stop, set_parameters), name="registration", daemon=True).start()


def _watch(stop: threading.Event, set_parameters: Callable[[], None]) -> None:
    master = Master(rosgraph.get_master_uri(), rospy.get_name())
    known = True
    while not stop.wait(_CHECK_EVERY_S):
        try:
            known = known and master.node_uri(rospy.get_name()) is not None
            if not known:  # repeated until everything is registered
                register_again(master, rospy.get_node_uri(), get_topic_manager(), get_service_manager())
                set_parameters()
                known = True
                log.info("registered again with the master, which had been restarted")
        except (MasterError, OSError):
            continue  # the master is away, or ended during the call
        except Exception:  # rospy's errors if the master ends while it answers
            log.exception("registering again failed")
